"""A store with its tables in memory, its colours, and the settings of the service."""
