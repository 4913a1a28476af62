#!/usr/bin/env bash
# The steps of deploy/Containerfile, one after the other, in a bare Debian root, for machines without a builder of
# containers: unpacks the tarball, makes the user, starts what ENTRYPOINT and CMD say as that user, fetches the page and
# asks HEALTHCHECK. A person runs it; it needs root.
#   tests/bare/container.sh [DIR of deploy/package, default: package]
set -euo pipefail
cd "$(dirname "$0")/../.."
packages=$(cd "${1:-package}" && pwd)
. tests/bare/root.sh

list() { python3 -c 'import json, sys; print("\0".join(json.loads(sys.argv[1])), end="\0")' "$1"; }
user=root folder=/ variables=() entry=() command=() health=()
while read -r verb rest; do
  case $verb in
    ''|'#'*|ARG|FROM|EXPOSE|STOPSIGNAL) ;;
    ADD)
      read -r what where <<<"$rest"
      for file in "$packages"/$what; do tar -xzf "$file" -C "$root$where"; done ;;
    RUN) in_root /bin/sh -c "$rest" ;;
    ENV) variables+=("$rest") ;;
    USER) user=$rest ;;
    WORKDIR) folder=$rest ;;
    HEALTHCHECK) mapfile -d '' health < <(list "${rest#*CMD }") ;;
    ENTRYPOINT) mapfile -d '' entry < <(list "$rest") ;;
    CMD) mapfile -d '' command < <(list "$rest") ;;
    *) echo "container.sh: what does '$verb' do?" >&2; exit 1 ;;
  esac
done <deploy/Containerfile

as_user=(setpriv --reuid "$user" --regid "$user" --clear-groups --no-new-privs env "${variables[@]}" /bin/sh -c "cd $folder"' && exec "$@"' -)
become_in_root "${as_user[@]}" "${entry[@]}" "${command[@]}" &
started=$!
python3 tests/package/fetch.py http://127.0.0.1:8080
# As a builder of containers does it: again until the server answers, a minute at most.
for _ in $(seq 1 20); do
  if in_root "${as_user[@]}" "${health[@]}" >"$root/health.json"; then healthy=1; break; fi
  sleep 3
done
[ -n "${healthy:-}" ] || { echo "container.sh: not healthy after a minute: $(cat "$root/health.json")" >&2; exit 1; }
python3 -c 'import json, sys; print("health:", *json.load(open(sys.argv[1]))["bodies"])' "$root/health.json"
kill -TERM "$started"
wait "$started" && echo "container: the steps of deploy/Containerfile hold on $suite"
started=
