#!/usr/bin/env python3
"""depends.py SHLIBS FILE...: the Depends line of ELF files, from their DT_NEEDED and Debian's own shlibs data: a file
that toolchains/sysroot collects, or the folder /var/lib/dpkg/info. Libraries of ours (libadit_*) are left out. A needed
library that no package brings is an error."""
import glob
import os
import re
import subprocess
import sys


def shlibs_lines(place):
    for path in glob.glob(place + "/*.shlibs") if os.path.isdir(place) else [place]:
        with open(path) as lines:
            yield from lines


def needed(path):
    text = subprocess.run(["readelf", "-d", path], capture_output=True, text=True, check=True).stdout
    return re.findall(r"NEEDED.*\[(.+)\]", text)


package_of = {}
for line in shlibs_lines(sys.argv[1]):
    words = line.split(None, 2)
    if len(words) == 3 and not words[0].endswith(":"):
        package_of[(words[0], words[1])] = words[2].strip()

depends, unknown = {}, set()
for path in sys.argv[2:]:
    for soname in needed(path):
        if soname.startswith(("libadit_", "ld-linux")):
            continue
        match = re.match(r"(.+)\.so\.(.+)$", soname) or re.match(r"(.+)-([\d.]+)\.so$", soname)
        package = package_of.get((match.group(1), match.group(2))) if match else None
        if package:
            depends[package.split(" ")[0]] = package
        else:
            unknown.add(soname)
if unknown:
    sys.exit(f"no package brings {sorted(unknown)}")
print(", ".join(sorted(depends.values())))
