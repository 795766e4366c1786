"""Studies: error against run time with a scene's choices varied, and stability in stiff and extreme cases."""
