#!/usr/bin/env bash
# Fails on C++ that clang-format would change. Usage: format_test.sh CLANG_FORMAT SOURCE_DIR
set -euo pipefail
clang_format=$1
cd "$2"
if files=$(git ls-files '*.cpp' '*.hpp' 2> /dev/null) && [ -n "$files" ]; then :; else
  # An unpacked archive: no git, but then nothing untracked either.
  files=$(find . -path ./build -prune -o \( -name '*.cpp' -o -name '*.hpp' \) -print)
fi
printf '%s\n' "$files" | xargs -d '\n' "$clang_format" --dry-run --Werror
