#!/usr/bin/env bash
# The report is tested in a browser: installs Chromium when root on Debian or Ubuntu, else says that those tests are skipped.
set -u
for name in chromium chromium-browser google-chrome; do command -v "$name" >/dev/null && exit 0; done
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "installing chromium for the report's tests"
  { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends chromium; } >/tmp/rigtwin-browser.log 2>&1 && exit 0
fi
echo "no chromium: the report's browser tests are skipped; on Debian or Ubuntu: sudo apt-get install chromium"
exit 0
