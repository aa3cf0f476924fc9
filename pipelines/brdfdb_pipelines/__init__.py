"""Batch jobs, recipes and the command line of brdfdb."""
