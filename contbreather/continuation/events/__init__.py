"""Events along a curve: detected and located."""
