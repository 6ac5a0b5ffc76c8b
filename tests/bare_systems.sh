#!/bin/sh
# Runs the README's two commands as a new user would, on bare systems: a Debian with git and nothing else, in a
# folder of its own, by debootstrap and chroot. What is committed in this checkout is what they run.
set -eu

usage() {
    cat <<END
usage: tests/bare_systems.sh [OPTIONS] [SUITE ...]

Suites of Debian, by default: bookworm trixie testing. Needs root and debootstrap, and 5 GB in the folder.

  -f FOLDER   where systems and logs are made (default: a new folder below \${TMPDIR:-/var/tmp})
  -m MIRROR   URL of Debian's archive (default: debootstrap's own; or DEBIAN_MIRROR)
  -s          accept a mirror that is stale: whose list of the suite has expired
  -c COMMAND  a command of ./run, instead of demo and test; may be given several times
  -k          keep the systems; without it the logs alone are kept

How this machine reaches its package indexes goes along: proxies and settings of apt and pip, and the certificates
that variables such as PIP_CERT and SSL_CERT_FILE name.
END
}

fail() {
    echo "bare_systems: $*" >&2
    exit 2
}

# ------------------------------------------------------------------------------- inside the mount namespace

# run_inside SYSTEM COMMAND...: nothing that is mounted here is seen outside, and all of it, with every process, goes
# when the command ends.
if [ "${1:-}" = --inside ]; then
    system=$2
    shift 2
    mount -t proc proc "$system/proc"
    mount -t sysfs -o ro sysfs "$system/sys"
    mount -t tmpfs tmpfs "$system/dev/shm"
    exec chroot "$system" "$@"
fi

run_inside() {
    unshare --mount --pid --fork --kill-child --propagation private "$script" --inside "$@"
}

# ------------------------------------------------------------------------------------------------- a system

# How package indexes are reached: files of apt and pip, certificates, and variables, in $system/root/environment.
carry_over() {
    for file in /etc/resolv.conf /etc/hosts /etc/pip.conf; do
        [ ! -f "$file" ] || cp "$file" "$system$file"
    done
    for file in "$HOME/.pip/pip.conf" "$HOME/.config/pip/pip.conf" "${PIP_CONFIG_FILE:-}"; do
        [ ! -f "$file" ] || install -D -m 644 "$file" "$system/root/.config/pip/pip.conf"
    done
    grep -lisE '^ *Acquire::(http|https|ftp)::?(proxy|cainfo|verify)' /etc/apt/apt.conf /etc/apt/apt.conf.d/* |
        while read -r file; do cp "$file" "$system/etc/apt/apt.conf.d/"; done
    [ -z "$stale" ] || echo 'Acquire::Check-Valid-Until "false";' >"$system/etc/apt/apt.conf.d/99stale"
    find /usr/local/share/ca-certificates -name '*.crt' -exec cp -t "$system/usr/local/share/ca-certificates" {} + \
        2>/dev/null
    run_inside "$system" update-ca-certificates || return
    env | grep -E "^($variables)=" >"$system/root/environment"
    while IFS='=' read -r _ value; do
        # A file of certificates that the system lacks.
        if [ -f "$value" ] && ! [ -e "$system$value" ]; then install -D -m 644 "$value" "$system$value"; fi
    done <"$system/root/environment"
}
variables='PIP_(INDEX_URL|EXTRA_INDEX_URL|TRUSTED_HOST|PROXY|CERT|DEFAULT_TIMEOUT|RETRIES)|SSL_CERT_FILE'
variables="$variables|REQUESTS_CA_BUNDLE|CURL_CA_BUNDLE|(http|https|no|all)_proxy|(HTTP|HTTPS|NO|ALL)_PROXY"

make_system() {
    # In a namespace too: it mounts things, and may be interrupted. Without a mirror that is no argument.
    unshare --mount --propagation private \
        debootstrap --variant=minbase --include=git,ca-certificates "$suite" "$system" ${mirror:+"$mirror"} &&
        carry_over &&
        git clone --quiet --no-hardlinks "$checkout" "$system/root/incpt"
}

# run_command COMMAND: of ./run, with nothing of this machine's environment but what was carried over.
run_command() {
    command=$1
    set -- HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    while IFS= read -r line; do set -- "$@" "$line"; done <"$system/root/environment"
    run_inside "$system" env -i "$@" sh -c "cd /root/incpt && ./run $command" </dev/null
}

# timed NAME COMMAND...: one line with the duration, the verdict and the last line; the output goes to a log.
timed() {
    name=$1
    shift
    log=$folder/$suite-$name.log
    start=$(date +%s)
    verdict=passed
    "$@" >"$log" 2>&1 || verdict=FAILED
    seconds=$(($(date +%s) - start))
    tests=$(grep -E '^=+ .*(passed|failed).* in [0-9.]+s' "$log" | tail -n 1 | tr -d '=')
    printf '%-9s %-11s %4d s  %s;%s %s\n' "$suite" "$name" "$seconds" "$verdict" "$tests" "$(tail -n 1 "$log")"
    [ "$verdict" = passed ] || failures=$((failures + 1))
    [ "$verdict" = passed ]
}

# ---------------------------------------------------------------------------------------------------- all

mirror=${DEBIAN_MIRROR:-} folder='' stale='' commands='' keep=''
while getopts f:m:sc:kh option; do
    case $option in
        f) folder=$OPTARG ;;
        m) mirror=$OPTARG ;;
        s) stale=yes ;;
        c) commands="$commands $OPTARG" ;;
        k) keep=yes ;;
        h) usage && exit ;;
        *) usage >&2 && exit 2 ;;
    esac
done
shift $((OPTIND - 1))
[ $# -gt 0 ] || set -- bookworm trixie testing

[ "$(id -u)" = 0 ] || fail "needs root, for chroot"
command -v debootstrap >/dev/null || fail "needs debootstrap; install it (Debian, Ubuntu: apt install debootstrap)"
script=$(realpath "$0")
checkout=$(git -C "$(dirname "$script")" rev-parse --show-toplevel) || fail "needs a checkout, to clone it"
[ -z "$(git -C "$checkout" status --porcelain)" ] || echo "bare_systems: what is not committed is not tested" >&2
if [ -n "$folder" ]; then
    mkdir -p "$folder"
else
    folder=$(mktemp -d "${TMPDIR:-/var/tmp}/incpt-bare.XXXXXX")
fi
folder=$(realpath "$folder")
echo "commit $(git -C "$checkout" rev-parse --short HEAD), logs in $folder"

# Outside the namespaces nothing is mounted below the folder; --one-file-system holds should it be otherwise.
remove() { [ -n "$keep" ] || rm -rf --one-file-system "$folder/$1.system"; }

failures=0
for suite in "$@"; do
    system=$folder/$suite.system
    trap 'remove "$suite"; exit 130' INT TERM
    [ ! -e "$system" ] || fail "$system is there already; remove it"
    if timed debootstrap make_system; then
        for command in ${commands:-demo test}; do timed "$command" run_command "$command" || true; done
    fi
    remove "$suite"
done
[ "$failures" = 0 ] || fail "$failures failed"
