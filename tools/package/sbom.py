#!/usr/bin/python3
"""Writes what a program consists of and links to, as SPDX 2.3 in JSON: the software bill of materials.

    sbom.py PROGRAM BUILD_DIR VERSION OUTPUT.spdx.json

Shared libraries are those of the dynamic linker, headers those that the compiler has read (`ninja -t deps`); both are
named by their Debian package, with version and the licences in its copyright file.
"""

import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import time


def output(*words):
    return subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False).stdout


def packages_of(files):
    """Names of the Debian packages of files; those of the C++ compiler and of Linux are left out."""
    found = output("dpkg", "-S", *sorted({str(pathlib.Path(file).resolve()) for file in files}))
    names = {line.split(":")[0] for line in found.splitlines() if not line.startswith("diversion")}
    return {name for name in names if not re.match(r"(lib)?(std)?(gcc|c\+\+|stdc\+\+)-?.*-dev$|libc6-dev|linux-libc-dev", name)}


def linked_libraries(program):
    return re.findall(r"(/\S+) \(0x", output("ldd", program))


def included_headers(build):
    """Of the sources of the program, not of tests and of the Python module."""
    headers, ours = set(), False
    for line in output("ninja", "-C", build, "-t", "deps").splitlines():
        if not line.startswith(" "):
            ours = not line.startswith(("tests/", "tools/python/"))
        elif ours and line.strip().startswith("/usr/"):
            headers.add(line.strip())
    return headers


def licences_of(package):
    text = pathlib.Path(f"/usr/share/doc/{package}/copyright")
    words = re.findall(r"^License: *(\S.*)$", text.read_text(errors="replace"), re.M) if text.exists() else []
    return sorted(set(words)) or ["see /usr/share/doc/" + package + "/copyright"]


def described(package):
    version, architecture = output("dpkg-query", "-W", "-f", "${Version}\n${Architecture}\n", package).split()[:2]
    return {"SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.]", "-", package), "name": package, "versionInfo": version,
            "supplier": "Organization: Debian", "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
            "licenseConcluded": "NOASSERTION", "licenseDeclared": "NOASSERTION", "copyrightText": "NOASSERTION",
            "licenseComments": "Licences in its copyright file: " + "; ".join(licences_of(package)),
            "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
                              "referenceLocator": f"pkg:deb/debian/{package}@{version}?arch={architecture}"}]}  # fmt: skip


def main():
    program, build, version, file = sys.argv[1:5]
    digest = hashlib.sha256(pathlib.Path(program).read_bytes()).hexdigest()
    linked = packages_of(linked_libraries(program))
    included = packages_of(included_headers(build)) - linked
    created = time.gmtime(int(os.environ.get("SOURCE_DATE_EPOCH", time.time())))
    ours = {"SPDXID": "SPDXRef-stageid", "name": "stageid", "versionInfo": version, "downloadLocation": "NOASSERTION",
            "filesAnalyzed": False, "licenseConcluded": "GPL-2.0-or-later", "licenseDeclared": "Apache-2.0",
            "licenseComments": "Linked with FFTW, so the program as a whole is under the GPL",
            "copyrightText": "NOASSERTION", "checksums": [{"algorithm": "SHA256", "checksumValue": digest}]}  # fmt: skip
    others = [described(package) for package in sorted(linked | included)]
    document = {
        "spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": "stageid-" + version,
        "documentNamespace": f"https://spdx.org/spdxdocs/stageid-{version}-{digest}",
        "creationInfo": {"created": time.strftime("%Y-%m-%dT%H:%M:%SZ", created), "creators": ["Tool: stageid-sbom.py"]},
        "packages": [ours, *others],
        "relationships": [
            {"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES", "relatedSpdxElement": ours["SPDXID"]},
            *({"spdxElementId": ours["SPDXID"], "relationshipType": "DYNAMIC_LINK" if one["name"] in linked else "CONTAINS",
               "relatedSpdxElement": one["SPDXID"]} for one in others)]}  # fmt: skip
    pathlib.Path(file).write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
