"""Where particles lie: the skin that is theirs, how they spread over it, and what gaps they leave."""
