"""A PostgreSQL server and a Slurm cluster of one node, for tests: in a folder of their own, for this machine only."""
import os
import pathlib
import pwd
import secrets
import shutil
import signal
import socket
import subprocess
import tempfile
import time


def wait_for(true, seconds, what):
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            raise RuntimeError(f"{what} does not happen within {seconds} s")
        time.sleep(0.05)


def socket_folder():
    """For sockets, whose paths have at most 107 characters."""
    return pathlib.Path(tempfile.mkdtemp(prefix="stageid-"))


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


class Postgres:
    """Reached by a socket. Its programs refuse to run as root, so root runs them as their own user."""

    @staticmethod
    def programs():
        found = sorted(pathlib.Path("/usr/lib/postgresql").glob("*/bin/initdb"))
        return found[-1].parent if found else None

    def __init__(self):
        self.folder = socket_folder()  # not in that of the test, which others may be unable to reach
        self.user = "postgres" if os.getuid() == 0 else pwd.getpwuid(os.getuid()).pw_name
        if os.getuid() == 0:
            shutil.chown(self.folder, self.user)
        self.call("initdb", "-D", self.folder / "data", "-U", self.user, "-A", "trust", "--no-sync")
        self.start()
        self.call("createdb", "-h", self.folder, "-U", self.user, "fleet")

    def call(self, name, *words):
        as_user = ["runuser", "-u", self.user, "--"] if os.getuid() == 0 else []
        subprocess.run([*as_user, self.programs() / name, *map(str, words)], check=True, cwd=self.folder,
                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def start(self):
        # Without waiting for the disk: a kill of the server loses nothing, only a power failure would.
        settings = f"-c listen_addresses='' -c unix_socket_directories='{self.folder}' -c fsync=off"
        self.call("pg_ctl", "-D", self.folder / "data", "-o", settings, "-l", self.folder / "log", "-w", "start")

    def url(self, schema):
        return f"postgresql://{self.user}@/fleet?host={self.folder}&options=-csearch_path%3D{schema}"

    def execute(self, sql):
        self.call("psql", "-q", "-h", self.folder, "-U", self.user, "-d", "fleet", "-c", sql)

    def kill(self):
        os.kill(int((self.folder / "data" / "postmaster.pid").read_text().split()[0]), signal.SIGKILL)

    def restart_after_kill(self):
        """Its processes end by themselves, a moment after their parent."""
        def started():
            try:
                self.start()
                return True
            except subprocess.CalledProcessError:
                return False
        wait_for(started, 60, "the start of the database")

    def stop(self):
        self.call("pg_ctl", "-D", self.folder / "data", "-m", "immediate", "stop")
        shutil.rmtree(self.folder)


class Slurm:
    """munged, slurmctld and slurmd on loopback."""

    @staticmethod
    def is_installed():
        return all(shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin:/sbin")
                   for name in ("munged", "slurmctld", "slurmd", "sbatch"))

    def __init__(self, folder, processors=2):
        self.folder = folder
        shutil.rmtree(folder, ignore_errors=True)
        for name in ("state", "spool"):
            (folder / name).mkdir(parents=True)
        self.sockets = socket_folder()
        key = folder / "key"
        key.write_bytes(secrets.token_bytes(1024))
        key.chmod(0o400)
        self.host = socket.gethostname().split(".")[0]
        user = pwd.getpwuid(os.getuid()).pw_name
        control, node = free_ports(2)
        self.settings = folder / "slurm.conf"
        self.settings.write_text(f"""ClusterName=test
SlurmctldHost={self.host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={self.sockets}/munge.socket
CredType=cred/munge
SlurmctldPort={control}
SlurmdPort={node}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
ReturnToService=2
SchedulerParameters=sched_interval=1,batch_sched_delay=0,sched_min_interval=0
MinJobAge=300
KillWait=1
NodeName=node NodeHostname={self.host} NodeAddr=127.0.0.1 CPUs={processors} State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
""")
        self.environment = {**os.environ, "SLURM_CONF": str(self.settings),
                            "PATH": os.environ["PATH"] + ":/usr/sbin:/sbin"}
        self.processes = {}
        try:
            self.start(key)
        except RuntimeError:
            self.stop()
            raise

    def start(self, key):
        self.daemon("munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.sockets}/munge.socket",
                    f"--pid-file={self.folder}/munged.pid", f"--seed-file={self.folder}/seed")
        wait_for((self.sockets / "munge.socket").exists, 30, "the start of munged")
        self.daemon("slurmctld", "-D", "-f", self.settings)
        self.daemon("slurmd", "-D", "-f", self.settings, "-N", "node")
        wait_for(lambda: "idle" in self.call("sinfo", "-h", "-o", "%T", check=False), 60, "a node that is ready")

    def daemon(self, name, *words):
        with open(self.folder / f"{name}.out", "a", encoding="utf-8") as output:
            self.processes[name] = subprocess.Popen([name, *map(str, words)], env=self.environment, stdin=subprocess.DEVNULL,
                                                    stdout=output, stderr=output, cwd=self.folder)

    def call(self, *words, check=True):
        return subprocess.run([*map(str, words)], env=self.environment, capture_output=True, text=True, check=check).stdout

    def kill_controller(self):
        self.processes["slurmctld"].kill()
        self.processes["slurmctld"].wait()

    def start_controller(self):
        self.daemon("slurmctld", "-D", "-f", self.settings)
        wait_for(lambda: "node" in self.call("sinfo", "-h", "-o", "%N", check=False), 60, "the controller")

    def resume_node(self):
        """As an administrator does: a controller that was killed before it saved its state drains the node."""
        self.call("scontrol", "update", "NodeName=node", "State=RESUME", check=False)

    def wait(self, job, seconds):
        wait_for(lambda: not self.call("squeue", "-h", "-j", job, check=False).strip(), seconds, f"the end of job {job}")

    def stop(self):
        for process in reversed(self.processes.values()):
            process.kill()
            process.wait()
        shutil.rmtree(self.sockets)
