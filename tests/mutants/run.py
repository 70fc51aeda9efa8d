#!/usr/bin/python3
"""Plants one fault at a time in a copy of the sources and shows which tests notice it.

    tests/mutants/run.py [--work DIR] [--only NAME] [--check]

Every mutant is one textual change; its folder's test program is built and run and must fail. A mutant
that no test notices, or whose text is no longer in the source, makes the run fail. Needs git, cmake,
ninja and the packages of tools/test; takes long, so only --check is part of ctest.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]

DAYS = ['acquisition:SimulatedDays.*']
# name, file, text, its replacement, test programs that should notice, or PROGRAM:TESTS
MUTANTS = [
    ('transient not dropped', 'frf/runs/run_periods.cpp',
     'wanted = (used_.transient_periods + p) * N_ - lost;', 'wanted = p * N_ - lost;', ['frf']),
    ('transpose of U', 'frf/plant/plant_average.cpp',
     'Y * inverse(U)', 'Y * inverse(U.transpose())', ['frf']),
    ('transpose of U in the covariance', 'frf/response/line_estimate.cpp',
     'estimate.Q.transpose() * weight.asDiagonal() * estimate.Q.conjugate()',
     'estimate.Q * weight.asDiagonal() * estimate.Q.adjoint()', ['frf']),
    ('missing conjugate in the covariance', 'frf/response/line_estimate.cpp',
     'factor * scatter * factor.adjoint()', 'factor * scatter * factor.transpose()', ['frf']),
    ('factor one half in the variance', 'frf/plant/plant_average.cpp',
     'frf.noise_variance = noise_sum_ / (M * M)', 'frf.noise_variance = 0.5 * noise_sum_ / (M * M)', ['frf']),
    ('lines of a zippered fit taken for independent', 'estimation/fit/fit_additive_model.cpp',
     'raise(covariance, frf.correlated_lines);', 'raise(covariance, 1.0);', ['estimation']),
    ('a pole in the mean costs no degrees of freedom', 'frf/statistics/local_fit.cpp',
     'mean.variance_dof = variance_dof(problem, fits, share);', 'mean.variance_dof = mean.dof + 0.0 * variance_dof(problem, fits, share);', ['frf']),
    ('neighbouring scatters taken for independent', 'frf/runs/run_spectra.cpp',
     'return x * (2.0 + x) / 3.0;', 'return 0.0 * x;', ['frf']),
    ('noise of the transient model forgotten', 'frf/runs/transient_model.cpp',
     '1.0 / fit.dof + shared * fit.weight', '1.0 / fit.dof + 0.0 * shared * fit.weight', ['frf']),
    ('stretches not weighted by their periods', 'frf/runs/record_spectra.cpp',
     'static_cast<double>(segment.periods) * part.mean', 'part.mean', ['frf']),
    ('zippered lines of the next axis', 'frf/plant/zippered_fit.cpp',
     '(i / bins_, 0)', '((i / bins_ + 1) % axes, 0)', ['frf']),
    ('transpose in what not knowing the pole adds', 'frf/plant/zippered_fit.cpp',
     'F.transpose() * weight.asDiagonal() * F.conjugate()', 'F.adjoint() * weight.asDiagonal() * F', ['frf']),
    ('a glitch replaced by periods that deviate', 'frf/runs/dropped_periods.cpp',
     'changed |= replace(outlier, outliers.consistent, replaced[p]);',
     '{ std::vector<std::size_t> all(P); std::iota(all.begin(), all.end(), std::size_t{0}); '
     'changed |= replace(outlier, all, replaced[p]); }', ['frf']),
    ('a deviation at an end of a period replaced', 'frf/runs/dropped_periods.cpp',
     'if (range.first <= 0 || range.end >= N) return false;',
     'if (range.first < 1 || range.end > N - 1) range = {std::max<Index>(range.first, 1), std::min(range.end, N - 1)};',
     ['frf']),
    ('any number of samples replaced', 'frf/runs/dropped_periods.cpp',
     'kLargestGap = 0.1;', 'kLargestGap = 1.0;', ['frf']),
    ('spectra as before the replacement', 'frf/runs/dropped_periods.cpp',
     'spectra += difference;', 'spectra += 0.0 * difference;', ['frf']),
    ('the line over a gap forgotten', 'frf/periods/bridge.cpp',
     'own(begin + n, c) = mean[n] + static_cast<float>(line);', 'own(begin + n, c) = mean[n] + 0.0F * static_cast<float>(line);',
     ['frf']),
    ('a glitch is evidence about drift and wiring', 'frf/plant/plant_frf.cpp',
     'if (part != nullptr) part->forget_deviating(run);', '', ['frf']),
    ('a glitch stays if steps are undone', 'frf/plant/plant_frf.cpp',
     'spoilt.push_back({one.realization, one.experiment, one.period, one.reason});', '(void)one;', ['frf']),
    ('a deviation at the last coefficient ends with it', 'frf/periods/period_outliers.cpp',
     'i + 1 == positions.size()', 'i > positions.size()', ['frf']),
    ('realizations count alike in the test of linearity', 'frf/response/nonlinearity.cpp',
     'known.total.size() > 0', 'known.total.size() < 0', ['frf']),
    ('records that are not settled are tested all the same', 'frf/response/nonlinearity.cpp',
     'settled_p_value[b] >= kUnsettledBelow', 'settled_p_value[b] >= 0.0', ['frf']),
    ('sinc of the hold forgotten', 'frf/response/hold_compensation.cpp',
     'kind == Compensation::hold ? sinc(0.5 * omega * T) : 1.0',
     'kind == Compensation::hold ? sinc(0.0 * omega * T) : 1.0', ['frf']),
    ('Hz for rad/s', 'frf/response/frf_estimate.cpp',
     'return 2.0 * std::numbers::pi * frequency_hz;', 'return frequency_hz;', ['frf', 'estimation']),
    ('Hz for rad/s in the natural frequency', 'estimation/model/additive_model.cpp',
     '1.0 / (2.0 * std::numbers::pi * std::sqrt(denominator[2]))', '1.0 / std::sqrt(denominator[2])', ['estimation']),
    ('missing conjugate in the arrow', 'estimation/products/weighted_products.cpp',
     'product.tail(n) = x_re.cwiseProduct(y_im) - x_im.cwiseProduct(y_re);',
     'product.tail(n) = x_re.cwiseProduct(y_im) + x_im.cwiseProduct(y_re);', ['estimation']),
    ('equation error added, not subtracted', 'estimation/equations/arrow_system.cpp',
     'channel.ba.leftCols(n_a) -= sums.FY', 'channel.ba.leftCols(n_a) += sums.FY', ['estimation']),
    ('frozen parameters move in factored steps', 'estimation/equations/factored_equations.cpp',
     'if (std::ranges::find(frozen, i) == frozen.end()) free.push_back(i);', 'free.push_back(i);',
     ['estimation']),
    ('reflected poles left unstable', 'estimation/start/pole_relocation.cpp',
     's = {-std::max(std::abs(s.real()), narrowest(size) * size), s.imag()}', 's = {s.real(), s.imag()}',
     ['estimation']),
    ('relative weights are the paper\'s', 'estimation/problem/weights.cpp',
     'case Weighting::relative:\n      return inverse_magnitude(frf, 2.0);',
     'case Weighting::relative:\n      return inverse_magnitude(frf, 1.0);', ['estimation']),
    ('hold without the rest of the delay', 'estimation/model/hold_integral.cpp',
     'return {whole, samples - whole};', 'return {whole, 0.0};', ['estimation']),
    ('delay states without the fraction', 'estimation/modal/sampled_state_space.cpp',
     '(rest > 0.0 ? 1.0 - rest : -rest)', '(rest > 0.0 ? 1.0 : -rest)', ['estimation']),
    ('imaginary part of a shape with the wrong sign', 'estimation/modal/state_space.cpp',
     '-2.0 * output.imag()', '2.0 * output.imag()', ['estimation']),
    ('MAC without the conjugate', 'estimation/modal/modal_assurance.cpp',
     'a.adjoint() * b', 'a.transpose() * b', ['estimation']),
    ('a larger cost is accepted', 'estimation/iteration/fit_iteration.cpp',
     'trial->solved.cost < cost_)', 'trial->solved.cost < 1e9 * cost_)', ['estimation']),
    ('CMIF not squared', 'estimation/model/cmif.cpp', '.cwiseAbs2();\n', '.cwiseAbs();\n', ['estimation']),
    ('even and odd lines swapped', 'excitation/multisine/frequency_grid.cpp',
     'return line % 2 != 0;', 'return line % 2 == 0;', ['excitation']),
    ('payload CRC not checked', 'acquisition/slog/slog_reader.cpp',
     'crc != block.header.payload_crc', 'false', ['acquisition']),
    ('slew limit not enforced', 'hal/stage/limited_stage.cpp',
     'std::abs(wanted - last) > step', 'std::abs(wanted - last) > 1e9 * step', ['hal']),
    # What a simulated day finds.
    ('forces beyond the thermal limit', 'hal/stage/limited_stage.cpp', 'std::min(largest, warm)', 'largest', DAYS),
    ('forces faster than the slew limit', 'hal/stage/limited_stage.cpp',
     'std::clamp(wanted, last - step, last + step)', 'wanted', DAYS),
    ('the stage is not stopped', 'acquisition/loop/measurement_loop.cpp', 'stage_.stop();', '', DAYS),
    ('a run that was stopped is complete', 'acquisition/loop/run_experiment.cpp',
     'run.complete = loop_.complete() && loop_.reason() != StopReason::log', 'run.complete = true', DAYS),
    ('a resumed log numbers its runs anew', 'acquisition/slog/slog_writer.cpp',
     'runs = block.header.run + 1', 'runs = block.header.run', DAYS),
    ('a resumed log repeats a sequence number', 'acquisition/slog/slog_appender.cpp',
     'next_sequence_ = next_sequence;', 'next_sequence_ = next_sequence - 1;', DAYS),
    ('a row has the measurement after its command', 'acquisition/loop/measurement_loop.cpp',
     'take_measurement(outcome); if (wall_clock_) [[unlikely]]',
     'std::copy(fresh_.begin(), fresh_.end(), row + u_.size()); take_measurement(outcome); if (wall_clock_)', DAYS),
    ('the command in the log, not the force', 'acquisition/loop/measurement_loop.cpp',
     '!inputs_.applied.empty()', 'false', DAYS),
    ('an old answer of the bus is taken', 'hal/can/can_stage.cpp',
     'header.sequence != expected_ || (frames_seen_', '(frames_seen_', DAYS),
    ('a repeated setpoint moves the stage', 'hal/can/can_node.cpp',
     'distance(header.sequence, last_sequence_) <= 0', 'distance(header.sequence, last_sequence_) < 0', DAYS),
    ('a complete run is not synchronized', 'acquisition/loop/log_thread.cpp',
     'log_.synchronize(); complete_runs_', 'complete_runs_', DAYS),
    ('a sensor beyond its hard window is ignored', 'hal/stage/limit_guard.cpp',
     'std::abs(y) > limits_.hard_window_m[i]', 'false', DAYS),
    ('a brake beyond a hard window goes on', 'hal/stage/limit_guard.hpp',
     '(hard && violation.kind != LimitKind::hard_position)', 'false', ['hal', 'acquisition:SimulatedDays.*']),
    ('bad cycles are not counted', 'acquisition/loop/measurement_loop.cpp', 'kBadCycle = 2', 'kBadCycle = 0', DAYS),
    ('the watchdog of a node sleeps', 'hal/node/stage_node.cpp',
     'now_ns - last_sample_ns_ > watchdog_ns_', 'false', DAYS),
    ('the last row of a block is lost', 'acquisition/loop/log_thread.cpp',
     'log_.write(rows)', 'log_.write(rows.first(rows.size() - ring_.row_words()))', DAYS),
    ('recovered rows at wrong places', 'acquisition/slog/slog_recover.cpp',
     '!fill(block.header.first_row)', 'false', DAYS),
    ('an interrupt is forgotten', 'acquisition/loop/run_experiment.cpp',
     'if (interrupted()) loop_.request_stop', 'if (false) loop_.request_stop', DAYS),
    ('a log that failed is taken for written', 'acquisition/loop/run_experiment.cpp',
     'if (log_.failed()) result_.take_log_failure(log_.error());', '', DAYS),
    ('samples lost in recovery are not counted', 'acquisition/slog/slog_recover.cpp',
     'run_->begin.health.lost += filled_;', '', ['acquisition:SlogRecover.*']),
    ('the excitation of another run', 'acquisition/loop/run_experiment.cpp',
     'plan_.excitation(id), actuators_', 'plan_.excitation(runs_.front()), actuators_', DAYS),
]


def changed(path, old, new):
    # Formatting may break a line anywhere: white space matches white space.
    pattern = r'\s*'.join(re.escape(part) for part in re.split(r'\s+', old))
    text, count = re.subn(pattern, lambda _: new, path.read_text(), count=1)
    if count == 0:
        raise SystemExit(f'{path}: the text of the mutant is gone: {old}')
    return text


def run(*command, **options):
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)


def test(build, tests):
    """(compiled, passed, first failing test)"""
    folder, _, only = tests.partition(':')
    if run('ninja', '-C', build, f'{folder}_tests').returncode != 0:
        return False, False, ''
    result = run(f'{build}/tests/{folder}/{folder}_tests', '--gtest_brief=1', f'--gtest_filter={only or "*"}', timeout=600)
    failed = re.findall(r'\[  FAILED  \] (\S+)', result.stdout)
    return True, result.returncode == 0, failed[0] if failed else f'exit code {result.returncode}'


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--work', default=str(ROOT / 'build' / 'mutants'))
    parser.add_argument('--only', default='', help='mutants whose name contains this')
    parser.add_argument('--check', action='store_true', help='only whether the texts are in the sources')
    arguments = parser.parse_args()
    if arguments.check:
        for _, file, old, new, _ in MUTANTS:
            changed(ROOT / file, old, new)
        return 0
    os.environ.setdefault('STAGEID_DAYS', '10')  # most are found in the first
    work = pathlib.Path(arguments.work)
    source, build = work / 'source', str(work / 'build')
    if not source.exists():
        subprocess.run(['git', 'clone', '--quiet', str(ROOT), str(source)], check=True)
    subprocess.run(['git', '-C', str(source), 'pull', '--quiet', '--ff-only'], check=True)
    subprocess.run(['cmake', '-S', str(source), '-B', build, '-G', 'Ninja', '-DCMAKE_BUILD_TYPE=Release'],
                   check=True, stdout=subprocess.DEVNULL)
    chosen = [m for m in MUTANTS if arguments.only in m[0]]
    for folder in sorted({folder for m in chosen for folder in m[4]}):
        compiled, passed, first = test(build, folder)
        if not (compiled and passed):
            raise SystemExit(f'{folder}_tests fail without a mutant: {first}')
    survivors = 0
    for name, file, old, new, folders in chosen:
        original = (source / file).read_text()
        (source / file).write_text(changed(source / file, old, new))
        noticed = []
        for folder in folders:
            compiled, passed, first = test(build, folder)
            if not compiled:
                raise SystemExit(f'{name}: the mutant does not compile')
            if not passed:
                noticed.append(first)
        (source / file).write_text(original)
        survivors += not noticed
        print(f'{name:42s} {file:32s} ' + (f'noticed by {", ".join(noticed)}' if noticed else 'SURVIVED'), flush=True)
    print(f'{len(chosen)} mutants, {survivors} survived')
    return 1 if survivors else 0


if __name__ == '__main__':
    sys.exit(main())
