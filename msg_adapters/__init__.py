"""ROS messages to border types and back: pure functions, one file per message package."""
