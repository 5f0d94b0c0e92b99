#!/bin/bash
# Unpacks PDAL 2.2 beside a Debian 12 that has none, so that its tests really run.
#
#   .ci/pdal.sh PREFIX        then TRIGPOINT_PDAL=PREFIX/bin/pdal
#
# Debian 11 was the last to package PDAL. Its packages and the libraries they need are unpacked
# under PREFIX; nothing is installed, and neither dpkg's records nor apt's sources are touched.
# Needs x86_64 and root. Fails with one line where the mirror no longer has Debian 11.
set -euo pipefail

fail() { echo "pdal.sh: $*" >&2; exit 1; }

[ $# -eq 1 ] || fail "usage: $0 PREFIX"
prefix=$(realpath -m "$1")
wrapper=$prefix/bin/pdal
if [ -x "$wrapper" ] && "$wrapper" --version >/dev/null 2>&1; then
    echo "$wrapper"
    exit 0
fi

[ "$(uname -m)" = x86_64 ] || fail "needs x86_64, and this is $(uname -m)"
[ "$(id -u)" = 0 ] || fail "needs root, to read the archive's keys and lists"
command -v apt-get >/dev/null || fail "needs apt-get, and this is no Debian"

keys=/usr/share/keyrings/debian-archive-keyring.gpg
mirror=$(awk '/^URIs:/ {print $2; exit}' /etc/apt/sources.list.d/debian.sources 2>/dev/null || true)
mirror=${mirror:-$(awk '$1 == "deb" && $2 ~ /^http/ {print $2; exit}' /etc/apt/sources.list 2>/dev/null || true)}
mirror=${mirror:-http://deb.debian.org/debian}

apt=$prefix/apt
rm -rf "$apt"
mkdir -p "$apt/lists/partial" "$apt/cache/archives/partial"
: > "$apt/status"
echo "deb [signed-by=$keys] $mirror bullseye main" > "$apt/sources.list"
options=(
    -qq
    -o "Dir::Etc::sourcelist=$apt/sources.list" -o Dir::Etc::sourceparts=- -o Dir::Etc::preferencesparts=-
    -o "Dir::State=$apt" -o "Dir::State::lists=$apt/lists" -o "Dir::State::status=$apt/status"
    -o "Dir::Cache=$apt/cache" -o APT::Update::Post-Invoke-Success::= -o Acquire::Languages=none
    -o APT::Sandbox::User=root -o Acquire::Check-Valid-Until=false
)
apt-get "${options[@]}" -o APT::Update::Error-Mode=any update || fail "$mirror has no bullseye (Debian 11)"
apt-get "${options[@]}" -y --no-install-recommends --download-only install pdal \
    || fail "$mirror has bullseye's index, and not PDAL's packages"

for package in "$apt"/cache/archives/*.deb; do
    case $(basename "$package") in
        # The C and C++ runtimes must be the host's own: these processes load both.
        libc6_* | libc-bin_* | libgcc-s1_* | libstdc++6_* | gcc-*-base_* | libcrypt1_*) continue ;;
    esac
    dpkg-deb -x "$package" "$prefix"
done
rm -rf "$apt" "$prefix"/usr/share/{doc,man,locale,lintian,bug}

mkdir -p "$prefix/bin"
cat > "$wrapper" <<EOS
#!/bin/sh
p="$prefix"
l="\$p/usr/lib/x86_64-linux-gnu"
export LD_LIBRARY_PATH="\$l:\$p/usr/lib:\$p/lib/x86_64-linux-gnu:\$l/blas:\$l/lapack\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
export GDAL_DATA="\$p/usr/share/gdal" PROJ_LIB="\$p/usr/share/proj" PDAL_DRIVER_PATH="\$p/usr/lib:\$l"
exec "\$p/usr/bin/pdal" "\$@"
EOS
chmod +x "$wrapper"
"$wrapper" --version >/dev/null || fail "PDAL was unpacked to $prefix and does not start"
echo "$wrapper"
