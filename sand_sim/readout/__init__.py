"""What is read out of a running world: grains, contacts, tools, heights, and whether to trust it."""
