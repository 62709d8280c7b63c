"""The lock pins everything with hashes, holds what the project is built on, and no CUDA."""

import re
import tomllib

import pytest

from drivelib import bootstrap

FIXED = ("jupyterlab", "numpy", "scipy", "scikit-fuzzy", "torch", "matplotlib", "papermill", "pytest")


@pytest.fixture(scope="module")
def blocks():
    return bootstrap.requirement_blocks(bootstrap.LOCK.read_text())


def test_every_requirement_is_pinned_and_hashed(blocks):
    assert len(blocks) > 100
    for name, text in blocks.items():
        for part in re.split(r"\n(?=\S)", text.strip()):
            assert re.match(r"[A-Za-z0-9._\[\]-]+==[^\s;]+", part), name
            assert re.search(r"--hash=sha256:[0-9a-f]{64}", part), name


def test_every_line_is_a_pin_a_hash_or_a_comment():
    for line in bootstrap.LOCK.read_text().splitlines():
        assert re.fullmatch(r"#.*|\s+--hash=sha256:[0-9a-f]{64}( \\)?|[A-Za-z0-9._\[\]-]+==[^;]+?(\s;\s.+)? \\", line), line


def test_the_fixed_packages_and_every_input_are_there(blocks, repository):
    project = tomllib.loads((repository / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = {re.match(r"[A-Za-z0-9._-]+", requirement).group().lower() for requirement in wanted}
    assert set(FIXED) <= names
    assert names <= set(blocks)


def test_torch_is_the_cpu_build_and_nothing_of_cuda_comes_along(blocks):
    assert "torch==2.13.0+cpu ; sys_platform == 'linux'" in blocks["torch"]
    assert not [name for name in blocks if re.search(r"nvidia|cuda|triton", name)]


def test_the_header_says_how_and_when_it_was_made():
    head = bootstrap.LOCK.read_text().splitlines()[:3]
    assert any(re.search(r"make lock LOCK_DATE=\d{4}-\d{2}-\d{2}", line) for line in head)


def test_it_names_no_address_and_no_folder():
    assert not re.search(r"https?:|file:|--find-links|--index", bootstrap.LOCK.read_text())


def test_what_runs_is_what_is_locked(blocks):
    """The environment of this run was installed from the lock."""
    from importlib import metadata

    for name in FIXED:
        assert f"{name}=={metadata.version(name)}" in blocks[name]
