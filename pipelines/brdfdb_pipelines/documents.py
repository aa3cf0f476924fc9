"""Generated documents that are kept in the repository for review: JSON Schemas.

``python -m brdfdb_pipelines.documents`` in the root of the repository writes them anew; the tests compare. Nothing
reads them at run time.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from brdfdb.audit import AuditReport
from brdfdb.conversion.document import Conversion
from brdfdb.fitting.document import Fits
from brdfdb.forms.tradeoff import Charts
from brdfdb.materials import Material
from brdfdb.scenes.choice import SceneChoice
from brdfdb.scenes.scene import Scene
from brdfdb.store.family import FamilyRecord
from brdfdb.tables.metadata import TableMetadata
from brdfdb_pipelines.recipe_file import Recipe

SCHEMAS: dict[str, type[BaseModel]] = {
    "audit": AuditReport,
    "chart": Charts,
    "choice": SceneChoice,
    "conversion": Conversion,
    "family": FamilyRecord,
    "fits": Fits,
    "material": Material,
    "recipe": Recipe,
    "scene": Scene,
    "table": TableMetadata,
}


def schema(name: str) -> str:
    """Return the text of ``schemas/<name>.schema.json``."""
    dialect = "https://json-schema.org/draft/2020-12/schema"
    document: dict[str, Any] = {"$schema": dialect, **SCHEMAS[name].model_json_schema()}
    if name == "family":  # the file that the store keeps begins with its digest
        seal = {"description": "of the lines below the first", "pattern": "^[0-9a-f]{64}$", "type": "string"}
        document["properties"] = {"sha256": seal, **document["properties"]}
        document["required"] = ["sha256", *document["required"]]
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for name in SCHEMAS:
        Path("schemas", f"{name}.schema.json").write_text(schema(name), encoding="utf-8")
