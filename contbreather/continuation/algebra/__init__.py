"""Newton's method, linear systems and derivatives."""
