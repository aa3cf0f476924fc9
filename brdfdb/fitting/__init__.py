"""Fits: the parameters of models that come closest to samples, with their intervals and the remaining error."""
