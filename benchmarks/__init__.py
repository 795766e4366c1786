"""What sand_sim measures about itself: speed, cost of features, published cases."""
