"""Where observations go besides ROS: recordings, histories, figures."""
