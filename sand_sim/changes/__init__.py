"""What may change while a world runs: grains come and go, tools get other bodies."""
