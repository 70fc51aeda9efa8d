# The Debian packages that the scripts need, and their installation. This is the only list.
# Sourced by tools/quickstart and tools/test.

# To build and run the program.
build_packages="g++ cmake ninja-build pkg-config
  libeigen3-dev libfftw3-dev libhdf5-dev libyaml-cpp-dev libcli11-dev nlohmann-json3-dev
  libfmt-dev libxxhash-dev libcpp-httplib-dev libmodbus-dev libzmq3-dev libmatio-dev zlib1g-dev libjs-dygraphs
  libboost-math-dev libutfcpp-dev libzip-dev libsqlite3-dev libpq-dev gnuplot-nox"

# Additional packages for the tests: the references in Python, the report in a browser, the format, the C++ reference,
# the documentation site, a database server and a cluster, a kernel with CAN, the stageid packages.
test_packages="libgtest-dev libgmock-dev libbenchmark-dev
  python3-dev pybind11-dev python3-venv dpkg-dev python3 python3-numpy python3-scipy python3-h5py python3-xarray chromium
  clang-format
  doxygen mkdocs python3-pygments libjs-katex groff-base git zsh lintian mypy
  postgresql slurm-wlm munge libopenmpi-dev openmpi-bin
  mbpoll python3-pymodbus python3-serial-asyncio socat
  user-mode-linux busybox-static iproute2 kmod can-utils"

# Only for tools/test --tidy.
tidy_packages="clang-tidy"

# install_packages NAME...: installs missing packages; calls apt-get only if there are any.
install_packages() {
  local missing="" package
  command -v dpkg-query > /dev/null ||
    fail "this script installs Debian packages; on another system install the likes of: $*"
  for package in "$@"; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2> /dev/null)" = installed ] ||
      missing="$missing $package"
  done
  [ -n "$missing" ] || return 0

  local as_root=""
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo > /dev/null ||
      fail "packages are missing and there is no sudo; as root: apt-get install --no-install-recommends$missing"
    as_root="sudo"
  fi
  say "Installing:$missing"
  # $missing and $as_root are word lists on purpose.
  # shellcheck disable=SC2086
  $as_root apt-get -q update &&
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -y install --no-install-recommends $missing ||
    fail "apt-get could not install:$missing"
}

say() { printf '\n== %s\n' "$*" >&2; }

fail() {
  printf '%s: %s\n' "${0##*/}" "$*" >&2
  exit 1
}
