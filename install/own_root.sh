#!/usr/bin/env bash
# Installs a wheel where there is no compiler and no network, and runs it as a user who may not write to site-packages, in a
# root of its own that goes away at the end. Of Linux, for root:
#     pip wheel -w WHEELS dist/levbench-*.whl && install/own_root.sh WHEELS [COMMAND...]
# WHEELS holds Levbench's wheel and those that it depends on, for the system's Python. The command is `bench`'s; by default
# `run amb-calibration --rig tsbs12`.
set -euo pipefail
if [ -z "${LEVBENCH_ROOT:-}" ]; then
    LEVBENCH_ROOT=$(mktemp -d)
    export LEVBENCH_ROOT
    trap 'rmdir "$LEVBENCH_ROOT"' EXIT
    unshare --mount --net "$0" "$@"  # what is mounted in there is gone with the last process
    exit
fi
wheels=$(realpath "$1")
shift
[ $# -gt 0 ] || set -- run amb-calibration --rig tsbs12
mount -t tmpfs none "$LEVBENCH_ROOT"
cd "$LEVBENCH_ROOT"
mkdir -p usr etc dev proc tmp opt home/person work/upper work/work wheels
mount -t overlay none -o lowerdir=/usr,upperdir=work/upper,workdir=work/work usr
rm -f usr/bin/{cc,gcc,clang,tcc,c89,c99}{,-*} usr/bin/*-{gcc,clang}{,-*} usr/local/bin/{cc,gcc,clang}
ln -s usr/bin usr/sbin usr/lib usr/lib64 .
cp /etc/ld.so.cache etc/
printf 'root:x:0:0::/:/bin/sh\nperson:x:1000:1000::/home/person:/bin/sh\n' > etc/passwd
mount --rbind /dev dev
mount -t proc none proc
mount --bind "$wheels" wheels
mount -o remount,bind,ro wheels
chown 1000:1000 home/person
chmod 1777 tmp
inside() {
    chroot "$LEVBENCH_ROOT" /usr/bin/env -i PATH=/opt/levbench/bin:/usr/bin HOME=/root OPENBLAS_NUM_THREADS=1 "$@"
}
person() {
    inside /usr/bin/setpriv --reuid=1000 --regid=1000 --clear-groups --no-new-privs --bounding-set=-all \
        /usr/bin/env HOME=/home/person /bin/sh -c 'cd; exec "$@"' sh "$@"
}
inside /usr/bin/python3 -m venv /opt/levbench
inside /opt/levbench/bin/pip install --quiet --no-index --find-links /wheels levbench
person sh -c 'for c in cc gcc clang; do ! command -v $c || exit 1; done; echo "no compiler"'
person sh -c '! touch /opt/levbench/lib/python3*/site-packages/x 2>/dev/null && echo "site-packages are read-only"'
person sh -c 'test "$(ls /sys/class/net 2>/dev/null | wc -l)" -eq 0; ! grep -qE "^ *(eth|en|wl)" /proc/net/dev && echo "no network"'
person bench "$@"
