"""Bifurcations of equilibria and of maps."""
