"""Editions: the published form of a database, immutable objects that a directory, a bucket or a web server holds.

edition.json                    the root, the only object that ever changes: digest of the index; sealed
index/SHA256.json               groups with the names of their members, families, the catalogue
catalogue/SHA256.parquet        what lists show, a row a material
families/SHA256.json            the record of a family
groups/SHA256.records           the records of a group: metadata of its members, their places in the shard, every digest
groups/SHA256/                  the group itself, zarr v3: members stacked along `material`, or the table of one

Objects are named by the sha256 of their content, groups by that of their records. The order of writing is data,
records, catalogue, index, root: what a reader finds is complete.
"""
