"""Where methods fail: forms of the models, ours and others, against high-precision values."""
