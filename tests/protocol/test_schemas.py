"""What is published about the messages is true and up to date."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from protocol import schemas
from protocol.keys import parse
from protocol.messages import BODIES, Envelope, decode

PUBLISHED = Path(__file__).resolve().parents[2] / "docs" / "messages"


def test_the_committed_documents_are_those_of_the_code() -> None:
    committed = {file.name: file.read_text(encoding="utf-8") for file in PUBLISHED.iterdir()}
    assert committed == schemas.documents(), "run `make docs` and commit the result"


def test_every_kind_has_a_valid_example() -> None:
    payloads = schemas.example_payloads()
    assert set(payloads) == set(BODIES)
    for kind, payload in payloads.items():
        assert decode(payload).kind == kind


def test_the_page_shows_messages_under_keys_that_are_theirs() -> None:
    page = schemas.documents()["README.md"]
    shown = re.findall(r"`(\S+)`\n\n```json\n(.*?)\n```", page, flags=re.DOTALL)
    assert len(shown) == len(BODIES)
    for key, text in shown:
        envelope = decode(text.encode())
        address = parse(key)
        assert address is not None
        assert address.kind == envelope.kind


def test_links_of_the_page_lead_somewhere() -> None:
    page = (PUBLISHED / "README.md").read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", page):
        assert (PUBLISHED / target).exists(), target


def conforms(value: Any, schema: dict[str, Any], root: dict[str, Any]) -> bool:
    """The part of JSON Schema 2020-12 that the schemas use, read from its specification."""
    if "$ref" in schema:
        return conforms(value, root["$defs"][schema["$ref"].removeprefix("#/$defs/")], root)
    if "anyOf" in schema:
        return any(conforms(value, option, root) for option in schema["anyOf"])
    if "enum" in schema:
        return value in schema["enum"]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    match schema["type"]:
        case "null":
            return value is None
        case "boolean":
            return isinstance(value, bool)
        case "integer" | "number" as kind:
            whole = kind == "number" or (number and float(value).is_integer())
            least, most = schema.get("minimum", -1e400), schema.get("maximum", 1e400)
            return bool(number and whole and least <= value <= most)
        case "string":
            fits = isinstance(value, str) and re.search(schema.get("pattern", ""), value) is not None
            return fits and schema.get("minLength", 0) <= len(value) <= schema.get("maxLength", 1 << 30)
        case "array":
            first = schema.get("prefixItems", [])
            rest = schema.get("items", {})
            return (
                isinstance(value, list)
                and schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 1 << 30)
                and all(conforms(item, part, root) for item, part in zip(value, first, strict=False))
                and (not value[len(first) :] or (rest is not False and all(conforms(i, rest, root) for i in value)))
            )
        case "object":
            fields = schema["properties"]
            return (
                isinstance(value, dict)
                and set(schema["required"]) <= set(value)
                and all(conforms(value[name], fields[name], root) for name in value if name in fields)
            )
    raise AssertionError(f"schema uses something new: {schema}")


@pytest.mark.parametrize("kind", sorted(BODIES))
def test_examples_conform_to_the_published_schemas_and_damaged_ones_do_not(kind: str) -> None:
    content = json.loads(schemas.example_payloads()[kind])
    whole = json.loads((PUBLISHED / "envelope.schema.json").read_text(encoding="utf-8"))
    body = json.loads((PUBLISHED / f"{kind}.schema.json").read_text(encoding="utf-8"))
    assert conforms(content, whole, whole)
    assert conforms(content["body"], body, body)
    assert not conforms({**content, "sender": "No Name"}, whole, whole)
    for field in body["$defs"][BODIES[kind].__name__]["required"]:
        without = {name: value for name, value in content["body"].items() if name != field}
        assert not conforms(without, body, body)
        assert not conforms({**content, "body": without}, whole, whole)


def test_every_field_that_is_on_the_wire_is_on_the_page() -> None:
    page = schemas.documents()["README.md"]
    for struct in (Envelope, *BODIES.values()):
        for field in struct.__struct_fields__:
            assert f"| `{field}` |" in page


def test_the_command_writes_them_and_says_how_it_is_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert schemas.main([str(tmp_path / "new")]) == 0
    assert {file.name for file in (tmp_path / "new").iterdir()} == set(schemas.documents())
    assert schemas.main([]) == 2
    assert "usage" in capsys.readouterr().err
