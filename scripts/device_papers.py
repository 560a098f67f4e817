"""Write what a device's file says of its software: two SBOMs, the SOUP sheet and the notices of third parties.

python scripts/device_papers.py            # write them
python scripts/device_papers.py --check    # fail where one is not what would be written

They are made of docs/device/components.toml, the versions of constraints-release.txt and constraints-build.txt,
models/models.toml and what each model says of itself. CycloneDX and SPDX are written and checked by these projects' own
libraries. constraints-papers.txt has what this needs.
"""

from __future__ import annotations

import importlib.metadata
import io
import json
import re
import sys
import tomllib
import uuid
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import onnx
from cyclonedx.model import ExternalReference, ExternalReferenceType, HashAlgorithm, HashType, Property, XsUri
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentScope, ComponentType
from cyclonedx.model.contact import OrganizationalEntity
from cyclonedx.model.license import LicenseExpression
from cyclonedx.output.json import JsonV1Dot6
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from license_expression import get_spdx_licensing
from packageurl import PackageURL
from spdx_tools.spdx.model import (
    Actor,
    ActorType,
    Checksum,
    ChecksumAlgorithm,
    CreationInfo,
    Document,
    ExternalPackageRef,
    ExternalPackageRefCategory,
    Package,
    Relationship,
    RelationshipType,
    SpdxNoAssertion,
)
from spdx_tools.spdx.validation.document_validator import validate_full_spdx_document
from spdx_tools.spdx.writer.json.json_writer import write_document_to_stream

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "device"
CYCLONEDX, SPDX, SOUP = FOLDER / "endosdk.cdx.json", FOLDER / "endosdk.spdx.json", FOLDER / "soup.md"
NOTICES = ROOT / "THIRD_PARTY_NOTICES.md"
LOCKED = (ROOT / "constraints-release.txt", ROOT / "constraints-build.txt")
SUPPLIER = "endosdk maintainers"
# Of a component that is in one place alone.
RELATIONS = {"build": RelationshipType.BUILD_DEPENDENCY_OF, "optional": RelationshipType.OPTIONAL_DEPENDENCY_OF}
SCOPES = {"build": ComponentScope.EXCLUDED, "optional": ComponentScope.OPTIONAL}
# Of the list, not of a build: the same sources give the same papers.
CREATED = datetime(2026, 11, 1, tzinfo=UTC)


def version() -> str:
    """Return the version of endosdk."""
    return str(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"])


def licence() -> str:
    """Return the licence of endosdk."""
    return str(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["license"])


def components() -> list[dict[str, Any]]:
    """Return the components, each with its version."""
    versions = locked_versions()
    listed = tomllib.loads((FOLDER / "components.toml").read_text())["component"]
    return [{**entry, "version": entry.get("version") or versions[entry["name"]]} for entry in listed]


def locked_versions() -> dict[str, str]:
    """Return the version of every package that is locked for a release, or for building it."""
    text = "\n".join(file.read_text() for file in LOCKED)
    return dict(re.findall(r"^([\w-]+)==([\w.]+)", text, re.MULTILINE))


def _purl(entry: dict[str, Any]) -> PackageURL:
    if "purl" in entry:
        return PackageURL.from_string(entry["purl"])
    return PackageURL("pypi", name=entry["name"], version=entry["version"])


@cache
def models() -> dict[str, dict[str, str]]:
    """Return the shipped models, each with the version and the licence that its file states."""
    listed = tomllib.loads((ROOT / "models" / "models.toml").read_text())
    return {name: {**entry, **_stated(ROOT / "models" / entry["file"])} for name, entry in listed.items()}


def _stated(file: Path) -> dict[str, str]:
    said = {entry.key: entry.value for entry in onnx.load(file).metadata_props}
    return {"version": said["endosdk.version"], "licence": said["endosdk.license"]}


def cyclonedx() -> str:
    """Return the SBOM in CycloneDX 1.6."""
    ours = OrganizationalEntity(name=SUPPLIER)
    root = Component(
        name="endosdk",
        version=version(),
        type=ComponentType.LIBRARY,
        bom_ref="endosdk",
        supplier=ours,
        licenses=[LicenseExpression(licence())],
    )
    bom = Bom(serial_number=uuid.uuid5(uuid.NAMESPACE_URL, f"endosdk-{version()}"))
    bom.metadata.component = root
    bom.metadata.timestamp = CREATED
    parts = [_component(entry) for entry in components()]
    parts += [
        Component(
            name=name,
            version=entry["version"],
            type=ComponentType.MACHINE_LEARNING_MODEL,
            bom_ref=f"model:{name}",
            supplier=ours,
            licenses=[LicenseExpression(entry["licence"])],
            hashes=[HashType(alg=HashAlgorithm.SHA_256, content=entry["sha256"])],
        )
        for name, entry in models().items()
    ]
    for part in parts:
        bom.components.add(part)
    bom.register_dependency(root, parts)
    text: str = JsonV1Dot6(bom).output_as_string(indent=1)
    if (fault := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)) is not None:
        raise ValueError(f"not CycloneDX: {fault}")
    return text + "\n"


def _component(entry: dict[str, Any]) -> Component:
    return Component(
        name=entry["name"],
        version=entry["version"],
        type=ComponentType.LIBRARY,
        bom_ref=entry["name"],
        scope=SCOPES.get(entry["in"][0], ComponentScope.REQUIRED) if len(entry["in"]) == 1 else ComponentScope.REQUIRED,
        properties=[Property(name="endosdk:in", value=", ".join(entry["in"]))],
        supplier=OrganizationalEntity(name=entry["supplier"]),
        licenses=[LicenseExpression(entry["licence"])],
        purl=_purl(entry),
        description=entry["purpose"],
        external_references=[ExternalReference(type=ExternalReferenceType.WEBSITE, url=XsUri(entry["site"]))],
    )


def spdx() -> str:
    """Return the SBOM in SPDX 2.3."""
    stream = io.StringIO()
    write_document_to_stream(_document(), stream)
    return json.dumps(json.loads(stream.getvalue()), indent=1) + "\n"


def _document() -> Document:
    info = CreationInfo(
        "SPDX-2.3",
        "SPDXRef-DOCUMENT",
        f"endosdk-{version()}",
        f"https://spdx.org/spdxdocs/endosdk-{version()}",
        [Actor(ActorType.TOOL, "scripts/device_papers.py")],
        CREATED,
    )
    root = _own_package("endosdk", version(), licence())
    packages, relationships = [root], [_relation("SPDXRef-DOCUMENT", RelationshipType.DESCRIBES, root)]
    for entry in components():
        package = _package(entry)
        kind = RELATIONS.get(entry["in"][0] if len(entry["in"]) == 1 else "", RelationshipType.DEPENDENCY_OF)
        packages.append(package)
        relationships.append(_relation(package.spdx_id, kind, root))
    for name, entry in models().items():
        package = _own_package(f"model-{name}", entry["version"], entry["licence"])
        package.checksums = [Checksum(ChecksumAlgorithm.SHA256, entry["sha256"])]
        packages.append(package)
        relationships.append(_relation(root.spdx_id, RelationshipType.CONTAINS, package))
    document = Document(info, packages=packages, relationships=relationships)
    if faults := validate_full_spdx_document(document):
        raise ValueError(f"not SPDX: {faults[0].validation_message}")
    return document


def _relation(of: str, kind: RelationshipType, to: Package) -> Relationship:
    return Relationship(of, kind, to.spdx_id)


def _own_package(name: str, number: str, declared: str) -> Package:
    return Package(
        f"SPDXRef-{name}",
        name,
        SpdxNoAssertion(),
        version=number,
        files_analyzed=False,
        license_concluded=SpdxNoAssertion(),
        license_declared=get_spdx_licensing().parse(declared),
        supplier=Actor(ActorType.ORGANIZATION, SUPPLIER),
    )


def _package(entry: dict[str, Any]) -> Package:
    package = _own_package(entry["name"], entry["version"], entry["licence"])
    package.supplier = Actor(ActorType.ORGANIZATION, entry["supplier"])
    package.homepage = entry["site"]
    package.comment = f"in: {', '.join(entry['in'])}"
    package.external_references = [
        ExternalPackageRef(ExternalPackageRefCategory.PACKAGE_MANAGER, "purl", _purl(entry).to_string()),
    ]
    return package


def soup() -> str:
    """Return the SOUP sheet."""
    lines = [
        "# Software of unknown provenance (SOUP)",
        "",
        "Third-party components in a device, their known anomalies, and how endosdk handles them.",
        "Names in brackets are [requirements](requirements.md) with tests. These lists are not complete.",
        "Check the issue list of each component before you release a device.",
        "`python scripts/device_papers.py` writes this page, [CycloneDX](endosdk.cdx.json) and",
        "[SPDX](endosdk.spdx.json).",
        "",
        "| component | version | licence | where | what for |",
        "| --- | --- | --- | --- | --- |",
    ]
    for entry in components():
        name = f"[{entry['name']}]({entry['site']})"
        cells = [name, entry["version"], entry["licence"], ", ".join(entry["in"]), entry["purpose"]]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "## Known anomalies that touch endosdk", ""]
    for entry in components():
        lines += [f"- **{entry['name']}**: {anomaly}" for anomaly in entry["anomalies"]]
    return "\n".join(lines) + "\n"


def notices() -> str:
    """Return the licences of what is compiled into the packages, in their own words."""
    lines = ["# Notices of third parties", "", "Parts of these are compiled into the packages of endosdk."]
    for entry in (entry for entry in components() if "inside" in entry["in"]):
        lines += ["", f"## {entry['name']} {entry['version']}", "", "```", _licence_text(entry).rstrip(), "```"]
    return "\n".join(lines) + "\n"


def _licence_text(entry: dict[str, Any]) -> str:
    if "licence_file" in entry:
        return (FOLDER / entry["licence_file"]).read_text()
    files = importlib.metadata.files(entry["name"]) or []
    return next(file for file in files if file.name == "LICENSE").read_text()


def main() -> None:
    """Write all four, or check them."""
    papers = {CYCLONEDX: cyclonedx(), SPDX: spdx(), SOUP: soup(), NOTICES: notices()}
    if sys.argv[1:] == ["--check"]:
        stale = [str(file.relative_to(ROOT)) for file, text in papers.items() if file.read_text() != text]
        sys.exit(f"not what scripts/device_papers.py writes: {', '.join(stale)}" if stale else None)
    for file, text in papers.items():
        file.write_text(text)


if __name__ == "__main__":
    main()
