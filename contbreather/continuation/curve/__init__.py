"""Curves H(z) = 0: problems, their points and branches."""
