"""The ROS 2 node. The only part of sand_sim that knows ROS, and what it alone needs: TF frames, filters, patterns of names."""
