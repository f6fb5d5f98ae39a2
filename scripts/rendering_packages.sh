#!/usr/bin/env bash
# Makes sure that MuJoCo can render without a display: installs what is missing when root on Debian or Ubuntu, else says how.
set -u
render() { MUJOCO_GL=egl "${BIN:-.venv/bin}/python" -c '
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco/>")
renderer = mujoco.Renderer(model, 8, 8)
renderer.close()' >/dev/null 2>&1; }

render && exit 0
packages="libegl1 libgl1 libgl1-mesa-dri"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "installing $packages for rendering"
  { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $packages; } >/tmp/rigtwin-apt.log 2>&1 ||
    { echo "could not install $packages; see /tmp/rigtwin-apt.log"; exit 1; }
  render && exit 0
fi
echo "rendering without a display does not work here; on Debian or Ubuntu: sudo apt-get install $packages"
exit 1
