#!/usr/bin/python3
"""Packs the built Python package into a wheel, without network and without build programs of Python.

    wheel.py PACKAGE_DIR VERSION OUTPUT_DIR --licence FILE --readme FILE [--strip PROGRAM]

PACKAGE_DIR is stageid/ of the build tree. Prints the file that it wrote. The same inputs give the same bytes.
Source: PEP 427 (wheel), PEP 376 (RECORD), PEP 566 (METADATA).
"""

import argparse
import base64
import hashlib
import pathlib
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

PACKED = ("*.py", "*.pyi", "py.typed")
EARLIEST = (1980, 1, 1, 0, 0, 0)  # the earliest time in a zip; the build time is not recorded


def tag():
    """Of this interpreter and this machine, as the compiled part needs them."""
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{version}-{version}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"


def metadata(version, readme):
    return f"""Metadata-Version: 2.1
Name: stageid
Version: {version}
Summary: Measures and identifies multivariable motion stages in closed loop
License: Apache-2.0; linked with FFTW, so passed on under the GPL-3.0
Requires-Python: =={sys.version_info.major}.{sys.version_info.minor}.*
Requires-Dist: numpy
Description-Content-Type: text/markdown

{readme}"""


def wheel_info():
    return f"""Wheel-Version: 1.0
Generator: stageid
Root-Is-Purelib: false
Tag: {tag()}
"""


def compiled(package, strip):
    found = sorted(package.glob(f"_native*{sysconfig.get_config_var('EXT_SUFFIX')}"))
    if len(found) != 1:
        sys.exit(f"{package}: {len(found)} compiled modules; build the target stageid_python first")
    if not strip:
        return found[0].name, found[0].read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        stripped = pathlib.Path(folder, found[0].name)
        subprocess.run([strip, "--strip-unneeded", "-o", stripped, found[0]], check=True)
        return found[0].name, stripped.read_bytes()


def record_line(name, content):
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(content)}\n"


def pack(arguments):
    info = f"stageid-{arguments.version}.dist-info"
    name, content = compiled(arguments.package, arguments.strip)
    files = {f"stageid/{file.name}": file.read_bytes() for pattern in PACKED
             for file in sorted(arguments.package.glob(pattern))}
    files[f"stageid/{name}"] = content
    files[f"{info}/LICENSE"] = arguments.licence.read_bytes()
    files[f"{info}/METADATA"] = metadata(arguments.version, arguments.readme.read_text()).encode()
    files[f"{info}/WHEEL"] = wheel_info().encode()
    record = "".join(record_line(name, content) for name, content in files.items())
    files[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n".encode()

    wheel = arguments.output / f"stageid-{arguments.version}-{tag()}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, EARLIEST)
            entry.external_attr = (0o755 if name.endswith(".so") else 0o644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return wheel


def main():
    parser = argparse.ArgumentParser(description="Packs the built Python package into a wheel.")
    parser.add_argument("package", type=pathlib.Path)
    parser.add_argument("version")
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--licence", type=pathlib.Path, required=True)
    parser.add_argument("--readme", type=pathlib.Path, required=True)
    parser.add_argument("--strip", help="program that removes what nobody needs of the compiled part")
    print(pack(parser.parse_args()))


if __name__ == "__main__":
    main()
