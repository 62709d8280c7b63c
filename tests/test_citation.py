"""CITATION.cff holds what format 1.2.0 asks for, this version, and the papers of the ledgers."""

import re
import tomllib

import pytest
import yaml

from drivelib import ledger


@pytest.fixture(scope="module")
def citation(repository):
    return yaml.safe_load((repository / "CITATION.cff").read_text())


def test_it_has_the_required_fields_of_the_format(citation):
    """Required by the format's schema: version, message, title, authors; a reference needs authors, title and type."""
    assert citation["cff-version"] == "1.2.0"
    for entry in (citation, *citation["references"]):
        assert entry["title"] and entry["authors"] and entry["type"]
        assert all("name" in author or {"family-names", "given-names"} <= set(author) for author in entry["authors"])
    assert citation["message"]


def test_its_version_is_the_projects(citation, repository):
    assert citation["version"] == tomllib.loads((repository / "pyproject.toml").read_text())["project"]["version"]


def test_each_paper_of_the_ledgers_is_cited(citation):
    def plain(text):
        return re.sub(r"\W+", " ", text).lower()

    for paper in ledger.papers().values():
        if paper.id != "beyond":
            assert any(plain(entry["title"]) in plain(paper.citation) for entry in citation["references"]), paper.id
