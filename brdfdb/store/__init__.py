"""The store on disk: revisions of tables, their manifests and pointers, and a store behind a service."""
