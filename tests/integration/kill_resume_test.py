#!/usr/bin/python3
"""Kills `stageid run` with SIGKILL at random moments and takes the experiment up again.

    kill_resume_test.py PROGRAM CONFIG WORK_DIR [KILLS [REALIZATIONS]]

After every kill: `log recover` gives a log that `log verify` accepts, `run --resume` completes the
experiment, and the FRF has the same bytes as that of an experiment that nobody disturbed. A second kill
may hit the resumed run too.
"""
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import time


def stageid(program, *arguments, wanted=(0,)):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode not in wanted:
        sys.exit(f'stageid {" ".join(map(str, arguments))}: exit code {done.returncode}\n{done.stdout}{done.stderr}')
    return done


def killed_run(program, config, log, seconds, resume):
    """True if the run was killed before it ended."""
    command = [program, 'run', config, '-o', log] + (['--resume'] if resume else [])
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        process.wait(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.wait()
        return True
    return False


def with_realizations(config, work, realizations):
    """The configuration with another number of realizations, in `work`."""
    if realizations is None:
        return config
    text = pathlib.Path(config).read_text()
    stage = re.search(r'^stage: (\S+)', text, re.M).group(1)
    text = text.replace(stage, str((pathlib.Path(config).parent / stage).resolve()))
    out = work / 'experiment.yaml'
    out.write_text(re.sub(r'realizations: \d+', f'realizations: {realizations}', text))
    return out


def finish_and_estimate(program, config, folder):
    """Completes the experiment in `folder`; the bytes of its FRF."""
    log = folder / 'run.slog'  # the FRF names its inputs
    stageid(program, 'run', config, '-o', log, *(['--resume'] if log.exists() else []))
    stageid(program, 'frf', log, '-o', folder / 'frf.h5')
    return (folder / 'frf.h5').read_bytes()


def main():
    program, config, work = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    kills = int(sys.argv[4]) if len(sys.argv) > 4 else 20
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    config = with_realizations(config, work, sys.argv[5] if len(sys.argv) > 5 else None)
    undisturbed = work / 'undisturbed'
    undisturbed.mkdir()
    start = time.monotonic()
    stageid(program, 'run', config, '-o', undisturbed / 'run.slog')
    duration = time.monotonic() - start
    wanted = finish_and_estimate(program, config, undisturbed)

    chance = random.Random(1)
    died = 0
    for i in range(kills):
        folder = work / f'kill{i}'
        folder.mkdir()
        log = folder / 'run.slog'
        hit = killed_run(program, config, log, chance.uniform(0.0, duration), False)
        died += hit
        if not hit:  # the run is faster than the undisturbed one was
            duration *= 0.8
        if hit and log.exists():
            recovered = folder / 'recovered.slog'
            stageid(program, 'log', 'recover', log, '-o', recovered, wanted=(0, 1, 2, 3))
            if recovered.exists():
                stageid(program, 'log', 'verify', recovered, wanted=(0, 3))
        if hit and i % 4 == 0 and log.exists():
            killed_run(program, config, log, chance.uniform(0.0, duration), True)
        if finish_and_estimate(program, config, folder) != wanted:
            sys.exit(f'kill {i}: the FRF of the resumed experiment differs')
        shutil.rmtree(folder)
    print(f'{kills} runs, {died} killed before their end: every FRF is the same, byte by byte')
    if died < kills // 2:
        sys.exit('too few runs were hit: nothing was shown')


if __name__ == '__main__':
    main()
