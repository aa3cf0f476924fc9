"""Documents of a release, made of its edition: how to cite it, and what catalogues of data read of it.

They are CITATION.cff with the data, a record of DataCite (schema 4.5), a Dataset of schema.org, and the same as
Croissant, which describes the columns of the catalogue. What only the owner can state has the mark `UNSTATED`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from brdfdb.distribution import NO_LICENCE, UNSTATED, distribution

Json = dict[str, Any]

# Names of Croissant 1.0, and prefixes of the vocabularies
_NAMES = (
    *("citeAs", "column", "equivalentProperty", "extract", "field", "fileProperty", "fileObject", "fileSet", "format"),
    *("includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex"),
    *("repeated", "replace", "samplingRate", "separator", "source", "subField", "transform"),
)
_CONTEXT: Json = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{name: f"cr:{name}" for name in _NAMES},
}
_TYPES = {"string": "sc:Text", "int64": "sc:Integer", "double": "sc:Float", "bool": "sc:Boolean"}  # by those of Parquet


class EditionFacts(NamedTuple):
    """Facts of an edition that the documents state."""

    digest: str
    date: str  # of the commit that the release is made of, as 2026-11-29
    libraries: Mapping[str, int]  # number of materials of each library, by its title
    objects: int
    bytes: int
    catalogue: str  # path from the directory of the release
    catalogue_bytes: int
    columns: Mapping[str, str]  # of the catalogue: their types in Parquet

    @property
    def materials(self) -> int:
        """Return the number of materials."""
        return sum(self.libraries.values())

    @property
    def title(self) -> str:
        """Return the title of the edition."""
        return f"brdfdb {distribution().version}: BRDF tables of {self.materials} materials"

    @property
    def abstract(self) -> str:
        """Return a description of the edition."""
        contents = "; ".join(f"{title} ({number})" for title, number in self.libraries.items())
        return f"{distribution().summary}. Each table states its error. {contents}."


def citation(text: str, edition: EditionFacts) -> str:
    """Return the text of CITATION.cff with the date of the release and a reference to the edition."""
    value = f'value: "sha256:{edition.digest}"'
    said = 'description: "digest of the edition"'
    dated = f"date-released: {edition.date}\nidentifiers:\n  - type: other\n    {value}\n    {said}\n"
    authors = "".join(f'      - name: "{name}"\n' for name in distribution().authors)
    reference = (
        f'  - type: database\n    title: "{edition.title}"\n    abstract: "{edition.abstract}"\n    authors:\n{authors}'
        f'    version: "{distribution().version}"\n    date-released: {edition.date}\n'
        f"    identifiers:\n      - type: other\n        {value}\n        {said}\n"
    )
    licence = distribution().licence
    stated = f"license: {licence}\n" if licence else f"# license: {NO_LICENCE}\n"
    text = text.rstrip().replace("references:\n", f"{stated}{dated}references:\n", 1)  # the last of its fields
    return f"{text}\n{reference}"


def datacite(text: str, edition: EditionFacts) -> Json:
    """Return the record of the edition for DataCite; `text` is CITATION.cff, whose DOIs it is derived from."""
    stated = distribution()
    rights = {"rights": stated.licence, "rightsIdentifier": stated.licence, "rightsIdentifierScheme": "SPDX"}
    return {
        "schemaVersion": "http://datacite.org/schema/kernel-4",
        "types": {"resourceType": "BRDF tables", "resourceTypeGeneral": "Dataset"},
        "titles": [{"title": edition.title}],
        "creators": [{"name": name} for name in stated.authors],
        "publisher": {"name": ", ".join(stated.authors)},
        "publicationYear": edition.date[:4],
        "dates": [{"date": edition.date, "dateType": "Issued"}],
        "language": "en",
        "version": stated.version,
        "subjects": [{"subject": keyword} for keyword in stated.keywords],
        "descriptions": [{"description": edition.abstract, "descriptionType": "Abstract"}],
        "alternateIdentifiers": [{"alternateIdentifier": edition.digest, "alternateIdentifierType": "SHA-256"}],
        "relatedIdentifiers": [
            {"relatedIdentifier": doi, "relatedIdentifierType": "DOI", "relationType": "IsDerivedFrom"}
            for doi in re.findall(r"^ +doi: (\S+)$", text, re.MULTILINE)
        ],
        "sizes": [f"{edition.materials} materials", f"{edition.objects} files", f"{edition.bytes} bytes"],
        "formats": ["application/vnd.apache.parquet", "application/json", "Zarr 3"],
        "rightsList": [rights if stated.licence else {"rights": NO_LICENCE}],
    }


def schema_org(edition: EditionFacts) -> Json:
    """Return the edition as a Dataset of schema.org, for the front page of the site, which lies beside the edition."""
    return {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        **_dataset(edition),
        "variableMeasured": {
            "@type": "PropertyValue",
            "name": "bidirectional reflectance distribution function",
            "unitText": "1/sr",
        },
        "distribution": [
            {
                "@type": "DataDownload",
                "name": "catalogue of the edition",
                "contentUrl": f"../{edition.catalogue}",
                "contentSize": f"{edition.catalogue_bytes} B",
                "encodingFormat": "application/vnd.apache.parquet",
            }
        ],
    }


def croissant(edition: EditionFacts) -> Json:
    """Return the edition as Croissant 1.0: the catalogue as a file and a set of records, a row a material."""
    name = "materials"
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        **_dataset(edition),
        "citeAs": f"{edition.title}, {edition.date}, sha256:{edition.digest}",
        "distribution": [
            {
                "@type": "cr:FileObject",
                "@id": "catalogue",
                "name": "catalogue",
                "contentUrl": edition.catalogue,
                "contentSize": f"{edition.catalogue_bytes} B",
                "encodingFormat": "application/x-parquet",  # readers of Croissant know this name of the type only
                "sha256": Path(edition.catalogue).stem,
            }
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": name,
                "name": name,
                "description": "the catalogue: a row for each material",
                "key": {"@id": f"{name}/name"},
                "field": [
                    {
                        "@type": "cr:Field",
                        "@id": f"{name}/{column}",
                        "name": column,
                        "dataType": _TYPES[kind],
                        "source": {"fileObject": {"@id": "catalogue"}, "extract": {"column": column}},
                    }
                    for column, kind in edition.columns.items()
                ],
            }
        ],
    }


def front_page(text: str, dataset: Json) -> str:
    """Return the HTML of a page with a dataset as JSON-LD."""
    script = json.dumps(dataset, ensure_ascii=False).replace("</", r"<\/")
    return text.replace("</head>", f'<script type="application/ld+json">{script}</script>\n</head>', 1)


def _dataset(edition: EditionFacts) -> Json:
    """Return the fields of schema.org that its Dataset and that of Croissant share."""
    stated = distribution()
    creators = [{"@type": "Organization", "name": name} for name in stated.authors]
    return {
        "name": edition.title,
        "description": edition.abstract,
        "version": stated.version,
        "datePublished": edition.date,
        "identifier": f"sha256:{edition.digest}",
        "keywords": list(stated.keywords),
        "creator": creators,
        "publisher": creators,
        "license": stated.licence or NO_LICENCE,
        "url": stated.address or UNSTATED,
        "isAccessibleForFree": True,
        "size": f"{edition.bytes} B",
    }
