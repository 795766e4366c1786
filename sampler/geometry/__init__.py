"""Exact questions to triangles, and how they hang together."""
