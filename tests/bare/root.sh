# Sourced: a bare Debian root in $root, outside of the repository, and in_root to run a command in it.
# Needs root. SCINDO_BARE_ROOT says where (default /var/tmp/scindo-bare), SCINDO_BARE_SUITE which Debian.
[ "$(id -u)" = 0 ] || { echo "this test needs root: it makes a root file system" >&2; exit 77; }
. /etc/os-release
suite=${SCINDO_BARE_SUITE:-$VERSION_CODENAME}
pristine=${SCINDO_BARE_ROOT:-/var/tmp/scindo-bare}/$suite
root=$pristine.run
mounts=()
bind() {
  mkdir -p "$root$2"
  mount --bind "$1" "$root$2"
  mounts=("$root$2" "${mounts[@]}")
}
leave() {
  local mount
  [ -z "${started:-}" ] || { kill "$started" 2>/dev/null || true; wait "$started" 2>/dev/null || true; }
  for mount in "${mounts[@]}"; do umount -l "$mount"; done
  # Nothing below may still be mounted when the folder goes.
  grep -q " $root" /proc/mounts || rm -rf "$root"
}
in_root() { (become_in_root "$@"); }
# Takes the place of the shell, so that what is started with & is the command itself and can be ended.
become_in_root() {
  exec chroot "$root" /usr/bin/env -i HOME=/root LANG=C.UTF-8 PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin "$@"
}
port_file=tests/free_port.py

command -v debootstrap >/dev/null || apt-get install -y -qq --no-install-recommends debootstrap >/dev/null
if [ ! -e "$pristine/.complete" ]; then
  rm -rf "$pristine"
  mkdir -p "$(dirname "$pristine")"
  debootstrap --variant=minbase "$suite" "$pristine" >"$pristine.log" 2>&1 || { tail -5 "$pristine.log" >&2; exit 1; }
  touch "$pristine/.complete"
fi
rm -rf "$root"
cp -a "$pristine" "$root"
trap leave EXIT
bind /proc /proc
bind /dev /dev
for tool in node npm cc cargo; do
  ! in_root sh -c "command -v $tool" >/dev/null || { echo "the bare root has $tool" >&2; exit 1; }
done
