#!/bin/bash
# Puts QGIS 3.40 on a Debian 12, and beside it the environment that the plugin's tests run in.
#
#   .ci/qgis.sh ENVIRONMENT
#   PYTHONPATH=core:reporting:plugin:templates ENVIRONMENT/bin/python-beside-qgis pytest tests/qgis
#
# QGIS comes from bookworm-backports. The environment belongs to the same Python as PyQGIS, sees
# the system's packages and keeps its numpy and scipy, as the plugin's own installer does.
# Needs root. May be run again: what is there already is left alone. Fails with one line.
set -euo pipefail

fail() { echo "qgis.sh: $*" >&2; exit 1; }

[ $# -eq 1 ] || fail "usage: $0 ENVIRONMENT"
environment=$(realpath -m "$1")
root=$(realpath "$(dirname "$0")/..")
[ "$(id -u)" = 0 ] || fail "needs root, to install QGIS"
command -v apt-get >/dev/null || fail "needs apt-get, and this is no Debian"
# shellcheck disable=SC1091
[ "$(. /etc/os-release; echo "${VERSION_CODENAME:-}")" = bookworm ] || fail "needs Debian 12 (bookworm)"

export DEBIAN_FRONTEND=noninteractive
install() { apt-get install -y -qq --no-install-recommends -o DPkg::Lock::Timeout=600 "$@" >/dev/null; }
refresh() { apt-get update -qq -o DPkg::Lock::Timeout=600 >/dev/null; }
version() { dpkg-query -W -f '${Version}' "$1" 2>/dev/null || true; }

# QGIS looks for the font Open Sans at every start and downloads it where it is missing.
tools="fonts-open-sans xvfb xauth xdotool libxcb-icccm4 libxcb-keysyms1 libxcb-xinerama0 python3-venv"
missing=""
for package in $tools; do
    [ -n "$(version "$package")" ] || missing="$missing $package"
done

if dpkg --compare-versions "$(version qgis)" lt 3.40 || dpkg --compare-versions "$(version python3-qgis)" lt 3.40; then
    keys=/usr/share/keyrings/debian-archive-keyring.gpg
    mirror=$(awk '/^URIs:/ {print $2; exit}' /etc/apt/sources.list.d/debian.sources 2>/dev/null || true)
    mirror=${mirror:-http://deb.debian.org/debian}
    printf 'Types: deb\nURIs: %s\nSuites: bookworm-backports\nComponents: main\nSigned-By: %s\n' \
        "$mirror" "$keys" > /etc/apt/sources.list.d/bookworm-backports.sources
    refresh || fail "the lists of $mirror can't be read"
    install -t bookworm-backports qgis python3-qgis || fail "QGIS can't be installed from bookworm-backports"
elif [ -n "$missing" ]; then
    refresh || fail "the package lists can't be read"
fi
# shellcheck disable=SC2086
[ -z "$missing" ] || install $missing || fail "can't install:$missing"

# PyQGIS belongs to /usr/bin/python3, whichever python3 comes first on the PATH.
python=$environment/bin/python
if [ ! -x "$python" ]; then
    rm -rf "$environment"
    /usr/bin/python3 -m venv --system-site-packages "$environment" || fail "no virtual environment can be made"
fi
wanted=$(/usr/bin/python3 "$root/plugin/make_zip.py" --requirements; printf 'pytest>=8.3\npytest-qt\npytest-qgis\n')
if [ "$(cat "$environment/requirements.txt" 2>/dev/null || true)" != "$wanted" ]; then
    /usr/bin/python3 -c '
import numpy, scipy
for package in (numpy, scipy): print(f"{package.__name__}=={package.__version__}")' > "$environment/constraints.txt"
    echo "$wanted" > "$environment/wanted.txt"
    "$python" -m pip install -q --disable-pip-version-check \
        -c "$environment/constraints.txt" -r "$environment/wanted.txt" || fail "the Python packages can't be installed"
    mv "$environment/wanted.txt" "$environment/requirements.txt"
fi

# Python as QGIS has it: the system's packages come first, those of the environment after them.
beside=$environment/bin/python-beside-qgis
cat > "$beside" <<EOS
#!/bin/bash
export TRIGPOINT_QGIS_ENVIRONMENT=$environment
[ -n "\${DISPLAY:-}" ] || export QT_QPA_PLATFORM=\${QT_QPA_PLATFORM:-offscreen}
exec /usr/bin/python3 -c 'import runpy, site, sys
site.addsitedir("$("$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')")
sys.argv = sys.argv[1:]
runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)' "\$@"
EOS
chmod +x "$beside"
QT_QPA_PLATFORM=offscreen "$python" -c '
from qgis.core import Qgis
import numpy, pyvista
print(f"QGIS {Qgis.QGIS_VERSION}, numpy {numpy.__version__}, pyvista {pyvista.__version__}")'
