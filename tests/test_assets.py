"""Every file of a page travels with the package."""

from pathlib import Path

from setuptools import Distribution


def test_every_file_of_a_page_is_in_the_wheel(root, monkeypatch):
    monkeypatch.chdir(root)
    distribution = Distribution()
    distribution.parse_config_files()
    command = distribution.get_command_obj("build_py")
    command.ensure_finalized()
    command.manifest_files = {}  # what the package names itself, not what git tracks
    folders = {package: command.get_package_dir(package) for package in command.packages}
    packed = {Path(name) for folder in folders.items() for name in command.find_data_files(*folder)}
    assets = {file.relative_to(root) for file in (root / "src").rglob("assets/*")}
    assert {file.suffix for file in assets} == {".html", ".css", ".js", ".gz", ""}  # an atlas and its licence, too
    lists = {file.relative_to(root) for file in (root / "src").rglob("*.sha256")}
    assert len(lists) == 1
    assert (assets | lists) - packed == set()
