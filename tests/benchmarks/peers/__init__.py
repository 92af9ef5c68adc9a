"""The same closure branch and fold curve by other continuation programs, where installed."""
