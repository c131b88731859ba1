"""Readers and writers of data sets of learned simulators, and the conversion between them."""
