#!/usr/bin/env python3
"""Data and training by Slurm: Debian's slurmctld, slurmd and munged on the loopback, without accounting.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/slurm/slurm_test.py [BUILD] (as root)
"""
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.abspath(sys.argv.pop(1) if len(sys.argv) > 1 and not sys.argv[1].startswith("-") else
                        os.path.join(ROOT, "build"))
GRAUPEL = os.path.join(BUILD, "graupel")
RECIPE = os.path.join(ROOT, "scenes/recipes/hgn.json")
SMALL = ["--set", "counts.train=2", "--set", "counts.valid=1", "--set", "counts.test=1", "--set", "frames=8", "--set",
         "domain.dx=0.04", "--device", "cpu"]
NETWORK = ["--steps", "400", "--device", "cpu", "--threads", "1", "--seed", "1", "--set", "hgn.latent=8", "--set",
           "hgn.message_passing=1", "--set", "batch_scenes=1", "--set", "rollout_frames=2", "--set", "hgn.dx=0.04",
           "--set", "checkpoint_interval=20"]


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Slurm:
    """Daemons with all of their files in a folder."""

    def __init__(self, folder):
        self.folder, self.daemons = folder, []
        host, key, munge = socket.gethostname().split(".")[0], f"{folder}/munge.key", f"{folder}/munge.socket"
        with open(key, "wb") as file:
            file.write(os.urandom(64))
        os.chmod(key, 0o400)
        settings = f"""ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={munge}
CredType=cred/munge
CryptoType=crypto/munge
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
KillWait=2
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
NodeName={host} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""
        self.variables = {**os.environ, "SLURM_CONF": f"{folder}/slurm.conf"}
        with open(f"{folder}/slurm.conf", "w", encoding="utf-8") as file:
            file.write(settings)
        self.start("munged", "--foreground", "--force", f"--key-file={key}", f"--socket={munge}",
                   f"--pid-file={folder}/munged.pid", f"--log-file={folder}/munged.log",
                   f"--seed-file={folder}/munged.seed")
        self.wait_until(lambda: os.path.exists(munge), "munged")
        self.start("slurmctld", "-D", "-f", f"{folder}/slurm.conf")
        self.start("slurmd", "-D", "-f", f"{folder}/slurm.conf", "-N", host)
        self.wait_until(lambda: "idle" in self.run("sinfo", "-h", "-o", "%T", check=False), "slurmd")

    def start(self, program, *words):
        with open(f"{self.folder}/{program}.out", "wb") as log:
            self.daemons.append(subprocess.Popen([shutil.which(program), *words], env=self.variables, stdout=log,
                                                 stderr=log))

    def stop(self):
        for daemon in reversed(self.daemons):
            daemon.terminate()
        for daemon in self.daemons:
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()

    def wait_until(self, holds, what, seconds=60):
        end = time.time() + seconds
        while not holds():
            if time.time() > end:
                logs = [f"{self.folder}/{name}" for name in os.listdir(self.folder)
                        if name.endswith((".log", ".out")) and name != "graupel.log"]
                tails = "".join(f"\n{log}:\n{read(log)[-1500:]}" for log in logs)
                raise AssertionError(f"{what} took more than {seconds} s{tails}")
            time.sleep(0.1)

    def run(self, *words, check=True, **options):
        done = subprocess.run(words, env=self.variables, text=True, capture_output=True, **options)
        if check and done.returncode != 0:
            raise AssertionError(f"{words}\n{done.stdout}{done.stderr}")
        return done.stdout

    def job(self, number):
        """What scontrol tells of a job."""
        return dict(re.findall(r"(\w+)=(\S+)", self.run("scontrol", "-o", "show", "job", number)))


def read(file):
    with open(file, encoding="utf-8", errors="replace") as text:
        return text.read()


def content(file):
    with open(file, "rb") as data:
        return data.read()


def tensors(file):
    """The numbers of a safetensors file: what follows its header."""
    data = content(file)
    return data[8 + int.from_bytes(data[:8], "little"):]


class SlurmTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.top = tempfile.mkdtemp(prefix="graupel-slurm-")
        cls.addClassCleanup(shutil.rmtree, cls.top, ignore_errors=True)
        daemons, cls.folder = os.path.join(cls.top, "daemons"), os.path.join(cls.top, "it's a \"folder\" of $HOME")
        os.mkdir(daemons)
        os.mkdir(cls.folder)
        cls.slurm = Slurm.__new__(Slurm)
        cls.slurm.daemons = []
        cls.addClassCleanup(cls.slurm.stop)
        cls.slurm.__init__(daemons)

    def graupel(self, *words):
        return self.slurm.run(GRAUPEL, *words, cwd=self.folder)

    def script(self, name, *words):
        file = os.path.join(self.folder, name)
        with open(file, "w", encoding="utf-8") as text:
            text.write(self.graupel(*words))
        return file

    def wait_for(self, number, output):
        self.slurm.wait_until(lambda: self.slurm.job(number)["JobState"] not in ("PENDING", "RUNNING", "COMPLETING"),
                              f"job {number}", 120)
        self.assertEqual(self.slurm.job(number)["JobState"], "COMPLETED", read(output) if os.path.exists(output) else "")

    def test_an_array_and_its_merge_make_the_bytes_of_one_run(self):
        self.graupel("generate", RECIPE, "-o", "whole", *SMALL)
        submit = self.script("submit.sh", "generate", RECIPE, "-o", "it's parts", *SMALL, "--emit-slurm", "3")
        said = self.slurm.run("bash", submit, "--output=job-%x-%a.log", cwd=self.folder)
        merge = re.search(r"merge: job (\d+)", said).group(1)
        self.wait_for(merge, os.path.join(self.folder, "job-graupel-merge-4294967294.log"))
        for name in ("train.h5", "valid.h5", "test.h5", "metadata.json"):
            self.assertEqual(content(os.path.join(self.folder, "whole", name)),
                             content(os.path.join(self.folder, "it's parts", name)), name)
        shards = [read(os.path.join(self.folder, f"job-graupel-shards-{i}.log")) for i in range(3)]
        self.assertIn("is complete", "".join(shards))

    def test_shards_find_their_place_in_an_array_from_one_on(self):
        job = os.path.join(self.folder, "own.sh")
        with open(job, "w", encoding="utf-8") as text:
            text.write(f"#!/bin/sh\nexec {GRAUPEL} generate {RECIPE} -o own {' '.join(SMALL)} --threads 1 "
                       "--shard slurm\n")
        number = self.slurm.run("sbatch", "--parsable", "--wait", "--array=1-5:2", "--output=own-%a.log", job,
                                cwd=self.folder).strip()
        self.assertTrue(number)
        for task, shard in (1, 0), (3, 1), (5, 2):
            self.assertIn(f"task {task} of the Slurm array 1-5 makes shard {shard}/3",
                          read(os.path.join(self.folder, f"own-{task}.log")))
        self.assertTrue(os.path.exists(os.path.join(self.folder, "own/train.h5")))

    def test_a_training_that_is_signalled_is_requeued_and_ends_like_an_uninterrupted_one(self):
        if not os.path.exists(os.path.join(BUILD, "graupel-train")):
            self.skipTest("graupel-train is not built")
        self.graupel("generate", RECIPE, "-o", "data", *SMALL)
        words = ["train", "hgn", "--data", "data", *NETWORK, "--out"]
        self.graupel(*words, "uninterrupted")
        script = self.script("train.sh", *words, "it's a run", "--emit-slurm", "1")
        number = self.slurm.run("sbatch", "--parsable", "--output=train.log", script, cwd=self.folder).strip()
        log, run = os.path.join(self.folder, "train.log"), os.path.join(self.folder, "it's a run")
        self.slurm.wait_until(lambda: os.path.isdir(f"{run}/checkpoints") and os.listdir(f"{run}/checkpoints"),
                              "the first checkpoint")
        self.slurm.run("scancel", "--signal=USR1", "--batch", number)
        self.slurm.wait_until(lambda: self.slurm.job(number).get("Restarts") == "1", "the requeue")

        def started_again():  # Slurm itself waits two minutes before it starts a requeued job
            if self.slurm.job(number)["JobState"] == "PENDING":
                self.slurm.run("scontrol", "update", f"JobId={number}", "StartTime=now", check=False)
            return self.slurm.job(number)["JobState"] in ("RUNNING", "COMPLETED")

        self.slurm.wait_until(started_again, "the second start")
        self.wait_for(number, log)
        text = read(log)
        self.assertRegex(text, r"resumed at step [1-9]")
        self.assertIn("finished at step 400", text)
        self.assertEqual(tensors(os.path.join(run, "weights.safetensors")),
                         tensors(os.path.join(self.folder, "uninterrupted/weights.safetensors")))


if __name__ == "__main__":
    missing = [program for program in ("munged", "slurmctld", "slurmd", "sbatch") if not shutil.which(program)]
    if missing or os.geteuid() != 0:
        print(f"skipped: {missing[0]} is not installed" if missing else "skipped: the daemons need root")
        sys.exit(0)
    unittest.main()
