"""Contact physics: what a contact is, and one law per slot."""
