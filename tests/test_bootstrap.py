"""Setting up refuses what cannot work with a message that helps, and warns of what was not run."""

import pytest

from drivelib import bootstrap


def test_the_wrong_python_is_refused():
    with pytest.raises(SystemExit, match=r"needs Python 3\.11, this is 3\.12 .*make PYTHON="):
        bootstrap.check_host(version=(3, 12))


def test_too_little_disk_is_refused():
    with pytest.raises(SystemExit, match=r"1\.0 GiB free .* 3 GiB are needed"):
        bootstrap.check_host(version=(3, 11), free_bytes=2**30)


def test_a_processor_without_avx2_is_warned_of():
    warnings = bootstrap.check_host(version=(3, 11), free_bytes=2**40, cpu_flags={"sse2"})
    assert len(warnings) == 1
    assert "AVX2" in warnings[0] or "not run by us" in warnings[0]


def test_a_good_host_gets_no_warning_on_linux(monkeypatch):
    monkeypatch.setattr(bootstrap.sys, "platform", "linux")
    monkeypatch.setattr(bootstrap.platform, "machine", lambda: "x86_64")
    assert bootstrap.check_host(version=(3, 11), free_bytes=2**40, cpu_flags={"avx2"}) == []


def test_the_stamp_follows_the_lock(tmp_path, monkeypatch):
    monkeypatch.setattr(bootstrap, "LOCK", tmp_path / "lock")
    bootstrap.LOCK.write_bytes(b"a==1\n")
    first = bootstrap.wanted_stamp()
    bootstrap.LOCK.write_bytes(b"a==1\r\n")
    assert bootstrap.wanted_stamp() == first
    bootstrap.LOCK.write_bytes(b"a==2\n")
    assert bootstrap.wanted_stamp() != first
    monkeypatch.setattr(bootstrap.platform, "python_version", lambda: "3.11.99")
    assert bootstrap.wanted_stamp() != first


def test_the_torch_lines_are_taken_whole():
    blocks = bootstrap.requirement_blocks("# head\na==1 \\\n    --hash=sha256:0\ntorch==2 ; x \\\n    --hash=sha256:1\ntorch==2+cpu ; y \\\n    --hash=sha256:2\n")
    assert blocks["torch"] == "torch==2 ; x \\\n    --hash=sha256:1\ntorch==2+cpu ; y \\\n    --hash=sha256:2\n"
