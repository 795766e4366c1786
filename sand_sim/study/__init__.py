"""Studies of the method itself: error against run time, stability at the extremes."""
