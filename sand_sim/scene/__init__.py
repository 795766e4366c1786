"""The Scene: its types, how it is read and checked, and what follows from it before anything is allocated."""
