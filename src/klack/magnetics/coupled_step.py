r"""The step of windings that share a magnet or a boost capacitor.

As in the step of one coil (:mod:`klack.magnetics.flux_step`), but a piece ends at the first event
of any winding, and the currents are solved together (:mod:`klack.magnetics.coupled_piece`).  An
event found is checked again from its own end: where another winding has met a target before, the
piece ends there.  The energies balance exactly,

.. math:: \sum_m \int u_m i_m\,dt = \sum_m \int R_m i_m^2 dt + \text{eddy loss} + \Delta W
          + \sum \bar F\,\Delta y ,

with the work of each source by itself.
"""

from klack.machine.compiling.constant import constant
from klack.magnetics.coupled_piece import (
    coupled_current,
    coupled_discharged,
    coupled_gaps,
    coupled_linked,
    coupled_locate,
    coupled_rates,
    coupled_settle,
    coupled_solve,
    magnet_row,
    winding_path,
    winding_row,
    winding_voltage,
)
from klack.magnetics.coupled_table import CAPACITOR_ROW, MOST_WINDINGS, PER_WINDING
from klack.magnetics.drive_kernel import due_switch, jump_at, next_time, state_block
from klack.magnetics.flux_kernel import (
    circuit_energy,
    circuit_flux,
    circuit_heat,
    circuit_loss_and_force,
    stack,
)
from klack.magnetics.flux_pieces import (
    CAPACITOR_EMPTY,
    DIODE_BLOCKS,
    FIRST_PIECE,
    KEPT,
    LEAST_PIECE,
    MOST_EVENTS,
    NO_SWITCH,
    TELLING,
    bending,
    first_crossing,
    next_state,
    read_fluxes,
    write_fluxes,
)
from klack.magnetics.flux_table import MOST_TUBES, STOPS
from klack.magnetics.output_stage import recharged
from klack.magnetics.quiet_step import DIODE, allowed_bend
from klack.network.step_function import shift, step_function

__all__ = ["coupled_step"]

_LATE = 4  # times that a piece is shortened to an event before the one found


@step_function
def coupled_step(par, state, inp, out):  # type: ignore[no-untyped-def]
    """Step of windings: ports armature and base of each magnet."""
    t, h = inp[0], inp[1]
    magnets, windings, capacitors = int(par[0]), int(par[1]), int(par[2])
    size = int(par[3])
    caps = int(par[6])
    mode, entered = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    cycle, shut = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    current, blocked = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    voltage, mean = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    end, pulse = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    supply, ohmic = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    switches, diodes = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    clamp, opens = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    held, charged = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    after, gained = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    phi, rate, bend, flow = stack(out, 48), stack(out, 48), stack(out, 48), stack(out, 48)
    change, told_of = stack(out, 48), stack(out, 48)
    settled, spread = stack(out, 48), stack(out, 6)
    hints = stack(out, 800)
    middle, final, slope = stack(out, 144), stack(out, 144), stack(out, 144)
    ends, push = stack(out, 16), stack(out, MOST_WINDINGS)
    eddy, heat = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    largest, place = stack(out, MOST_WINDINGS), stack(out, MOST_WINDINGS)
    for j in range(6 * magnets):
        phi[j] = rate[j] = bend[j] = change[j] = 0.0

    per_step = 1.0 / h if h > 0.0 else 0.0
    for w in range(windings):
        s = PER_WINDING * w
        mode[w], entered[w], cycle[w] = state[s], state[s + 1], state[s + 2]
        shut[w] = 0.0 if state[s + 3] != 0.0 else 1.0
        current[w], pulse[w], blocked[w] = state[s + 4], 0.0, 0.0
        supply[w] = ohmic[w] = switches[w] = diodes[w] = clamp[w] = mean[w] = 0.0
    for c in range(capacitors):
        held[c], gained[c] = state[PER_WINDING * windings + c], 0.0
    for m in range(magnets):
        row = magnet_row(par, m)
        at, s = int(par[row]), int(par[row + 3]) + 1
        loops, spots, stops = int(par[at]), 2 * int(par[at + 1]), int(par[at + STOPS])
        read_fluxes(
            par, at, state, s,
            shift(phi, 6 * m), shift(rate, 6 * m), shift(bend, 6 * m), shift(hints, KEPT * m),
        )  # fmt: skip
        largest[m] = state[s + 3 * loops + spots + stops]
        y = 2 + 4 * m
        x0 = par[row + 1] + par[row + 2] * (inp[y] - inp[y + 2])
        x1 = par[row + 1] + par[row + 2] * (inp[y + 1] - inp[y + 3])
        place[m], ends[2 * m], ends[2 * m + 1] = x0, x0, (x1 - x0) * per_step
        push[m] = eddy[m] = heat[m] = 0.0
    last = state[size - 1]

    done = 0.0
    events = 0
    longest, bend_left = h, allowed_bend(h)
    close = 1e-9 * h + 1e-15 * abs(t)
    coupled_gaps(par, hints, ends, 0.0, middle, final, slope)
    if h > 0.0:  # at constant linkage: what an open winding lets go went at the end
        for w in range(windings):
            opens[w] = 0.0
        for m in range(magnets):
            released, warmed = coupled_settle(par, m, hints, phi, final, opens, spread)
            eddy[m] += released
            heat[m] += warmed
            for j in range(int(par[int(par[magnet_row(par, m)])])):
                phi[6 * m + j] += spread[j]
        for w in range(windings):  # no piece ends at a jump on the edge of a step
            block = state_block(par, int(par[winding_row(par, w) + 2]), int(mode[w]))
            jump = cycle[w] + jump_at(par, block, t - cycle[w], close) - t
            if jump <= close:
                early = jump - constant(jump)
                done += early
                for j in range(6 * magnets):
                    phi[j] += early * rate[j]
                break
    while done < h:
        now = t + done
        switched = timed = False
        early = 0.0  # as in a solenoid alone: derivatives of those that switch now, one by one
        for w in range(windings):
            row = winding_row(par, w)
            block = state_block(par, int(par[row + 2]), int(mode[w]))
            which = due_switch(par, block, now, entered[w], cycle[w], current[w], close)
            if which >= 0:
                for j in range(6 * magnets):
                    flow[j] = rate[j]
                if timed:
                    for m in range(magnets):
                        ends[2 * m] = place[m] + ends[2 * m + 1] * done
                    if not coupled_rates(
                        par, hints, phi, ends, LEAST_PIECE * h, mode, cycle, now, held, shut, flow
                    ):
                        return 1
                mode[w], entered[w], cycle[w] = next_state(
                    par, block, which, now, entered[w], cycle[w]
                )
                later = entered[w] - now - constant(entered[w] - now)
                for j in range(6 * magnets):
                    phi[j] += (later - early) * flow[j]
                early, timed = later, True
            elif par[row + 3] != 0.0:
                path = winding_path(par, row, mode[w])
                if held[int(par[row + 4])] > par[path + 7]:
                    continue
                mode[w], entered[w] = par[path + 8], now
            else:
                continue
            switched = True
            blocked[w] = 0.0
            events += 1
        if events > MOST_EVENTS * windings:
            return 2
        if switched:
            done += early
            last = 0.0  # the rates belong to the voltage before
            continue
        piece = h - done
        due = piece + h
        for w in range(windings):
            row = winding_row(par, w)
            block = state_block(par, int(par[row + 2]), int(mode[w]))
            if shut[w] == 0.0 and par[block + 1] == 0.0:
                shut[w] = 1.0  # nothing holds the current back
                last = 0.0
            due = min(due, next_time(par, block, now + close, entered[w], cycle[w]) - now)
        whole = due >= piece - close
        if not whole:
            piece = due
        longest = min(longest, max(2.0 * last if last > 0.0 else FIRST_PIECE * h, LEAST_PIECE * h))
        if longest < piece - close:
            piece, whole = constant(longest), False
        ahead = 0.5 * (last + piece)
        for j in range(6 * magnets):
            told_of[j] = change[j] = constant(piece * (rate[j] + bend[j] * ahead))
        for m in range(magnets):
            ends[2 * m] = place[m] + ends[2 * m + 1] * done
        coupled_gaps(par, hints, ends, piece, middle, final, slope)
        for c in range(capacitors):
            charged[c] = recharged(par, caps + CAPACITOR_ROW * c, held[c], 0.5 * piece)
        for w in range(windings):
            middle_time = now + 0.5 * piece - cycle[w]
            voltage[w] = winding_voltage(par, winding_row(par, w), mode[w], charged, middle_time)
        if not coupled_solve(par, hints, phi, change, middle, piece, mode, voltage, shut, mean):
            return 1
        bent = False
        for m in range(magnets):
            untold = 0.0
            for j in range(int(par[int(par[magnet_row(par, m)])])):
                untold = max(untold, abs(change[6 * m + j] - told_of[6 * m + j]))
                largest[m] = max(largest[m], abs(phi[6 * m + j] + change[6 * m + j]))
            bent = bent or untold > bend_left * largest[m]
        if last > 0.0 and bent and piece > LEAST_PIECE * h:
            longest = 0.5 * piece
            continue
        longest = 2.0 * piece
        for _ in range(windings):  # one that begins to conduct may let another begin
            starts = False
            for w in range(windings):
                through = coupled_linked(par, winding_row(par, w), change)
                if shut[w] == 0.0 and blocked[w] == 0.0 and voltage[w] > through / piece + DIODE:
                    shut[w] = 1.0
                    starts = True
            if not starts:
                break
            last = 0.0
            if not coupled_solve(par, hints, phi, change, middle, piece, mode, voltage, shut, mean):
                return 1
        # the first event of any winding, and again from its end
        event, which, failed, stays = -1, NO_SWITCH, False, True
        for _ in range(_LATE):
            found, first, goal, moves, before, beyond = -1, 2.0, 0.0, 0.0, 0.0, 0.0
            kind = NO_SWITCH
            for c in range(capacitors):
                _, after[c] = coupled_discharged(par, c, mode, charged[c], mean, piece)
            for w in range(windings):
                if shut[w] == 0.0 or w == event:
                    continue
                row = winding_row(par, w)
                block = state_block(par, int(par[row + 2]), int(mode[w]))
                end[w] = coupled_current(par, row, hints, phi, change, final)
                begin, within = now - cycle[w], min(close, 0.25 * piece)
                target, rise, crossed = first_crossing(
                    par, block, current[w], end[w], begin + within, begin + piece - within
                )
                if crossed == DIODE_BLOCKS and current[w] <= 0.0:
                    shut[w], blocked[w] = 0.0, 1.0
                    stays = False
                    break
                if crossed != NO_SWITCH:
                    share = (target - current[w]) / (end[w] - current[w] - rise)
                    if share < first:
                        found, first, kind, goal, moves = w, share, crossed, target, rise
                        before, beyond = current[w], end[w]
                if par[row + 3] != 0.0:
                    c, low = int(par[row + 4]), par[winding_path(par, row, mode[w]) + 7]
                    empty = event >= 0 and which == CAPACITOR_EMPTY
                    empty = empty and int(par[winding_row(par, event) + 4]) == c
                    if after[c] < low and not empty:
                        share = (held[c] - low) / (held[c] - after[c])
                        if share < first:
                            found, first, kind, goal, moves = w, share, CAPACITOR_EMPTY, low, 0.0
                            before, beyond = held[c], after[c]
            if not stays or found < 0:
                break
            length = piece
            piece = coupled_locate(
                par, hints, phi, change, ends, length, mode, cycle, now, held, shut, found,
                kind == CAPACITOR_EMPTY, before, beyond, goal, moves, mean,
            )  # fmt: skip
            if piece <= 0.0:
                failed = True
                break
            event, which, whole = found, kind, False
            coupled_gaps(par, hints, ends, piece, middle, final, slope)
            for c in range(capacitors):
                charged[c] = recharged(par, caps + CAPACITOR_ROW * c, held[c], 0.5 * piece)
            if kind == CAPACITOR_EMPTY:
                end[event] = coupled_current(
                    par, winding_row(par, event), hints, phi, change, final
                )
            else:
                end[event] = goal + moves * (piece / length)
        if failed:
            return 1
        if not stays:
            last = 0.0
            events += 1
            if events > MOST_EVENTS * windings:
                return 2
            continue
        per_time = 1.0 / piece
        for c in range(capacitors):
            passed, rest = coupled_discharged(par, c, mode, charged[c], mean, piece)
            half = 0.5 * par[caps + CAPACITOR_ROW * c]
            gained[c] += half * (
                (charged[c] - held[c]) * (charged[c] + held[c]) + (rest - passed) * (rest + passed)
            )
            held[c] = rest
        for w in range(windings):
            row = winding_row(par, w)
            through = coupled_linked(par, row, change)
            opens[w] = 0.0 if shut[w] != 0.0 else 1.0
            if w == event and which == DIODE_BLOCKS:
                opens[w] = 1.0
            if shut[w] == 0.0:
                end[w] = 0.0
                pulse[w] += through
                continue
            if w != event:
                end[w] = coupled_current(par, row, hints, phi, change, final)
            charge = mean[w] * piece
            square = mean[w] * charge
            ohmic[w] += par[row + 1] * square
            if par[row + 3] == 0.0:
                pulse[w] += voltage[w] * piece
                supply[w] += par[row + 1] * square + mean[w] * through
                continue
            pulse[w] += par[row + 1] * charge + through
            path = winding_path(par, row, mode[w])
            supply[w] += par[path] * charge
            switches[w] += par[path + 4] * square
            diodes[w] += par[path + 3] * charge + par[path + 5] * square
            clamp[w] += par[path + 1] * charge + par[path + 6] * square
        for m in range(magnets):
            row = magnet_row(par, m)
            at = int(par[row])
            loops = int(par[at])
            near, here, moved = shift(hints, KEPT * m), shift(phi, 6 * m), shift(change, 6 * m)
            loss, force = circuit_loss_and_force(par, at, here, moved, shift(slope, MOST_TUBES * m))
            eddy[m] += loss * per_time
            if par[at + STOPS] != 0.0:
                heat[m] += circuit_heat(par, at, near, here, moved)
            push[m] += force * piece
            for j in range(loops):
                settled[6 * m + j] = here[j] + moved[j]
            released, warmed = coupled_settle(par, m, hints, settled, final, opens, spread)
            if released > 0.0:
                eddy[m] += released
                heat[m] += warmed
                for j in range(loops):
                    settled[6 * m + j] += spread[j]
                    moved[j] += spread[j]
                for w in range(int(par[row + 4]), int(par[row + 4]) + int(par[row + 5])):
                    own, turns = winding_row(par, w), int(par[winding_row(par, w) + 5])
                    if shut[w] == 0.0:
                        for j in range(loops):
                            pulse[w] += par[turns + j] * spread[j]
                    elif opens[w] == 0.0:
                        end[w] = coupled_current(par, own, hints, phi, change, final)
        curve = bending(last, piece, ahead)
        told = piece > TELLING * h  # of a shorter piece the rate is round-off, and so is a guess
        for j in range(6 * magnets):
            if told:
                now_rate = change[j] * per_time
                bend[j] = (now_rate - rate[j]) * curve
                rate[j] = now_rate
            phi[j] += change[j]
        last = piece if told else 0.0
        for w in range(windings):
            current[w], blocked[w] = end[w], 0.0
        done = h if whole else done + piece
        if event >= 0:
            last = 0.0
            row = winding_row(par, event)
            if which == DIODE_BLOCKS:
                shut[event], blocked[event] = 0.0, 1.0
            elif which == CAPACITOR_EMPTY:
                path = winding_path(par, row, mode[event])
                mode[event], entered[event] = par[path + 8], t + done
            else:
                block = state_block(par, int(par[row + 2]), int(mode[event]))
                mode[event], entered[event], cycle[event] = next_state(
                    par, block, which, t + done, entered[event], cycle[event]
                )
            events += 1
            if events > MOST_EVENTS * windings:
                return 2

    o = 2 * magnets
    book = o + size
    for w in range(windings):
        s = o + PER_WINDING * w
        out[s], out[s + 1], out[s + 2] = mode[w], entered[w], cycle[w]
        out[s + 3] = 0.0 if shut[w] != 0.0 else 1.0
        out[s + 4], out[s + 5] = current[w], pulse[w] * per_step
        out[book], out[book + 1] = supply[w], ohmic[w]
        book += 2
        if par[winding_row(par, w) + 3] != 0.0:
            out[book], out[book + 1], out[book + 2] = switches[w], diodes[w], clamp[w]
            book += 3
    for c in range(capacitors):
        row = caps + CAPACITOR_ROW * c
        out[o + PER_WINDING * windings + c] = held[c]
        drawn = gained[c] / par[row + 4]
        out[book], out[book + 1] = drawn, drawn - gained[c]
        out[book + 2] = 0.5 * par[row] * held[c] * held[c]
        book += 3
    for m in range(magnets):
        row = magnet_row(par, m)
        at = int(par[row])
        loops, spots, stops = int(par[at]), 2 * int(par[at + 1]), int(par[at + STOPS])
        near, here = shift(hints, KEPT * m), shift(phi, 6 * m)
        out[2 * m] = par[row + 2] * push[m] * per_step
        out[2 * m + 1] = -out[2 * m]
        energy = circuit_energy(par, at, near, here, shift(final, MOST_TUBES * m))
        s = o + int(par[row + 3])
        out[s] = par[at + 4] * circuit_flux(par, at, int(par[at + 3]), here)
        write_fluxes(
            par, at, out, s + 1, here, shift(rate, 6 * m), shift(bend, 6 * m), near
        )  # fmt: skip
        out[s + 1 + 3 * loops + spots + stops] = largest[m]
        out[book], out[book + 1] = eddy[m], energy
        book += 2
        if stops > 0:
            out[book] = heat[m]
            book += 1
    out[o + size - 1] = last
    return 0
