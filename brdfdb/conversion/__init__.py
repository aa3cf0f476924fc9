"""Conversion from one model to another: the parameters that come closest, and the remaining error."""
