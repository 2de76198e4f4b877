"""Builds the package with the standard library alone (PEP 517 and 660), so that ``pip
install`` works without a network and without setuptools: there is nothing to compile, and
a wheel is a zip file with the modules, the metadata and a list of both."""

import ast
import base64
import hashlib
import pathlib
import tarfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent
EPOCH = (1980, 1, 1, 0, 0, 0)  # the same files give the same archive


def _project():
    """The table [project] of pyproject.toml, whose values are strings and lists of strings
    on one line each: Python reads them as TOML does. (``tomllib`` is there from 3.11 on.)"""
    table, inside = {}, False
    for line in (ROOT / "pyproject.toml").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            inside = line == "[project]"
        elif inside and " = " in line:
            name, value = line.split(" = ", 1)
            table[name] = ast.literal_eval(value)
    return table


def _name():
    return "{name}-{version}".format(**_project())


def _metadata():
    project = _project()
    lines = ["Metadata-Version: 2.1"]
    for field, name in [
        ("Name", "name"),
        ("Version", "version"),
        ("Summary", "description"),
        ("License", "license"),
        ("Requires-Python", "requires-python"),
    ]:
        lines.append(f"{field}: {project[name]}")
    lines += [f"Classifier: {classifier}" for classifier in project["classifiers"]]
    readme = (ROOT / project["readme"]).read_text(encoding="utf-8")
    return "\n".join([*lines, "Description-Content-Type: text/markdown", "", readme])


def _modules():
    found = sorted((ROOT / "fleetyard").glob("*.py")) + [ROOT / "fleetyard" / "py.typed"]
    return [(path.relative_to(ROOT).as_posix(), path.read_bytes()) for path in found]


def _wheel(directory, files):
    info = f"{_name()}.dist-info"
    about = "Wheel-Version: 1.0\nGenerator: fleetyard\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    files = [
        *files,
        (f"{info}/METADATA", _metadata().encode()),
        (f"{info}/WHEEL", about.encode()),
    ]
    record = ""
    for path, content in files:
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=")
        record += f"{path},sha256={digest.decode()},{len(content)}\n"
    files.append((f"{info}/RECORD", f"{record}{info}/RECORD,,\n".encode()))
    name = f"{_name()}-py3-none-any.whl"
    with zipfile.ZipFile(pathlib.Path(directory) / name, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files:
            entry = zipfile.ZipInfo(path, EPOCH)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return name


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    return _wheel(wheel_directory, _modules())


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    return _wheel(wheel_directory, [("fleetyard.pth", f"{ROOT}\n".encode())])


def build_sdist(sdist_directory, config_settings=None):
    name = f"{_name()}.tar.gz"
    own = ["pyproject.toml", "README.md", "build_backend.py"]
    paths = own + [path for path, _ in _modules()] + ["tests/test_fleetyard.py"]
    with tarfile.open(pathlib.Path(sdist_directory) / name, "w:gz") as archive:
        for path in paths:
            archive.add(ROOT / path, f"{_name()}/{path}")
        information = pathlib.Path(sdist_directory) / "PKG-INFO"
        information.write_text(_metadata(), encoding="utf-8")
        archive.add(information, f"{_name()}/PKG-INFO")
        information.unlink()
    return name
