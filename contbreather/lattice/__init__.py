"""The linear lattice between impacts, and what drives it. Knows nothing of impacts."""
