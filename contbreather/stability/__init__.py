"""Stability of a breather with one impacting site: plain numbers in, verdicts out."""
