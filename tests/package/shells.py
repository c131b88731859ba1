"""What bash, zsh and fish offer for a line that ends where Tab is pressed."""
import os
import pty
import select
import shutil
import subprocess
import tempfile
import time

BASH = r"""
source "$1"
COMP_LINE=$2 COMP_POINT=${#2} COMP_WORDS=() COMP_CWORD=0
# As readline breaks words: at blanks and, as words of their own, at = and :.
rest=$2
while [[ -n $rest ]]; do
  if [[ $rest =~ ^[[:blank:]]+ ]]; then :
  elif [[ $rest =~ ^[=:]+ || $rest =~ ^[^[:blank:]=:]+ ]]; then COMP_WORDS+=("${BASH_REMATCH[0]}")
  fi
  rest=${rest:${#BASH_REMATCH[0]}}
done
[[ $2 != *[[:blank:]=:] ]] || COMP_WORDS+=("")
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
COMP_WORDBREAKS=$' \t\n"\'><=;|&(:'
_graupel
((${#COMPREPLY[@]} == 0)) || printf '%s\n' "${COMPREPLY[@]}"
"""

ZSH = r"""
fpath=($1 $fpath)
autoload -Uz compinit && compinit -u -d $1/dump
compadd() {
  if [[ "${@[1,(i)(-|--)]}" != *-(O|A|D)\ * ]]; then
    local -a hits
    builtin compadd -A hits "$@"
    local hit
    for hit in $hits; do print -r -- "<hit>$hit</hit>"; done
  fi
  builtin compadd "$@"
}
_hits() { _main_complete; print -r -- '<end>' }
zle -C hits list-choices _hits
bindkey '^I' hits
PROMPT='<ready>'
"""


def offered_by_bash(script, line, folder):
    done = subprocess.run(["bash", "--norc", "-c", BASH, "bash", script, line], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return done.stdout.splitlines()


def offered_by_fish(script, line, folder):
    with tempfile.TemporaryDirectory() as home:
        done = subprocess.run(["fish", "--no-config", "-c", 'source $argv[1]; complete -C "$argv[2]"', script, line],
                              cwd=folder, capture_output=True, text=True, env={**os.environ, "HOME": home})
    assert done.returncode == 0 and not done.stderr, done.stderr
    return [word.split("\t")[0] for word in done.stdout.splitlines()]


class Terminal:
    """A shell on a terminal of its own."""

    def __init__(self, words, folder):
        self.process, self.master = pty.fork()
        if self.process == 0:
            os.chdir(folder)
            os.execvpe(words[0], words, {**os.environ, "TERM": "dumb", "COLUMNS": "200"})

    def type(self, text):
        os.write(self.master, text.encode())

    def read_until(self, mark, seconds=60):
        text, end = "", time.monotonic() + seconds
        while mark not in text:
            ready, _, _ = select.select([self.master], [], [], max(0, end - time.monotonic()))
            if not ready:
                raise AssertionError(f"'{mark}' did not come; the shell printed: {text[-2000:]}")
            text += os.read(self.master, 65536).decode(errors="replace")
        return text

    def close(self):
        os.close(self.master)
        os.waitpid(self.process, 0)


def offered_by_zsh(script, line, folder):
    with tempfile.TemporaryDirectory() as place:
        shutil.copy(script, os.path.join(place, "_graupel"))
        with open(os.path.join(place, "start"), "w", encoding="utf-8") as start:
            start.write(ZSH)
        shell = Terminal(["zsh", "-f", "-i"], folder)
        try:
            shell.type(f"source {place}/start {place}\n")
            shell.read_until("<ready>")
            shell.type(line + "\t")
            text = shell.read_until("<end>")
        finally:
            shell.close()
    return [part.split("</hit>")[0] for part in text.split("<hit>")[1:]]
