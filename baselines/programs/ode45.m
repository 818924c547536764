% Octave's ode45 with events; each mode is a separate call.
%
% The program reads the request from standard input and writes the response to standard output (docs/protocol.md). A
% guard that starts at zero, because its surface has just been left, is lifted by a few roundings. The first step of
% every call is short, because ode45 does not stop at an event in its first step.
1;

% Octave's functions return a complex number if there is no real value; these functions return NaN.
function r = real_or_nan (r)
  if (! isreal (r))
    r = NaN;
  end
end

function r = real_pow (a, b)
  r = real_or_nan (a .^ b);
end

function r = real_sqrt (a)
  r = real_or_nan (sqrt (a));
end

function r = real_log (a)
  r = real_or_nan (log (a));
end

function r = real_asin (a)
  r = real_or_nan (asin (a));
end

function r = real_acos (a)
  r = real_or_nan (acos (a));
end

% Make one function of t and u = [x; p] from texts of the request; it returns a column.
function f = made (texts, names)
  if (ischar (texts))
    texts = {texts};
  end
  texts = regexprep (reshape (texts, 1, []), "(?<![\\w.])(pow|sqrt|log|asin|acos)\\(", "real_$1(");
  for k = 1:numel (names)
    texts = regexprep (texts, ["(?<![\\w.])" names{k} "(?!\\w)"], sprintf ("@%d@", k));
  end
  texts = regexprep (texts, "@(\\d+)@", "u($1)");
  f = str2func (["@(t, u) [(" strjoin(texts, "); (") ")]"]);
end

% Convert one mode of the request; its texts become functions of t and u = [x; p].
function mode = made_mode (given, names)
  guards = as_list (given.guards);
  mode.mode = given.mode;
  mode.field = made (given.field, names);
  mode.guards = made (cellfun (@(g) g.expression, guards, "UniformOutput", false), names);
  mode.kinds = cellfun (@(g) g.kind, guards, "UniformOutput", false);
  mode.successors = cell (1, numel (guards));
  for k = 1:numel (guards)
    mode.successors{k} = cellfun (@(s) made_successor (s, names), as_list (guards{k}.successors),
                                  "UniformOutput", false);
  end
end

function successor = made_successor (given, names)
  successor.mode = given.mode;
  successor.ends = given.ends;
  successor.always = isempty (given.when);
  if (! successor.always)
    successor.when = made (given.when, names);
  end
end

% jsondecode returns an array of structs if their fields agree, otherwise a cell array.
function list = as_list (given)
  if (iscell (given))
    list = given;
  else
    list = arrayfun (@(k) given(k), 1:numel (given), "UniformOutput", false);
  end
end

function [values, terminal, direction] = events (t, x, mode, p, lift, stop_at)
  if (cputime () > stop_at)
    error ("henon_ref:timeout", "the time that a run may take has passed");
  end
  values = [mode.guards(t, [x; p]) + lift; 1e100 - sum(abs (x))];
  terminal = ones (numel (values), 1);
  direction = -terminal;
end

function run = ended (run, status, reason)
  run.status = status;
  run.reason = reason;
end

% Log the event of a guard that has fallen, and select the next mode or end the run.
function run = follow (run, task, mode, guard)
  if (! strcmp (mode.kinds{guard}, "valid"))
    [run.x, h] = projected (run.t, run.x, task);
    run.drift = max (run.drift, abs (h));
  end
  for candidate = mode.successors{guard}
    successor = candidate{1};
    if (successor.always || all (successor.when(run.t, [run.x; task.p]) >= 0))
      if (! isempty (successor.ends))
        run = ended (run, successor.ends, "the run ends where a guard has fallen");
        return;
      end
      run.events(end + 1, :) = [run.t, run.mode, successor.mode, run.x.'];
      run.mode = successor.mode;
      if (rows (run.events) >= task.most)
        run = ended (run, "failed", "more transitions than the request allows");
      elseif (rows (run.events) > 36 && run.t - run.events(end - 36, 1) <= max (64 * eps (run.t), 1e-12 * task.span))
        run = ended (run, "failed", "events accumulate");
      end
      return;
    end
  end
  run = ended (run, "failed", "no successor's conditions hold at the surface");
end

% Project x onto the surface by one Newton step; h is the surface's value before.
function [x, h] = projected (t, x, task)
  h = task.surface(t, [x; task.p]);
  gradient = task.gradient(t, [x; task.p]);
  if (any (gradient) && all (isfinite (gradient)))
    x -= h * gradient / sumsq (gradient);
  end
end

% Call ode45 once, up to the next event or the horizon.
function run = advance (run, task, mode, left, stop_at)
  lift = zeros (numel (mode.kinds), 1);
  if (left)
    size = abs (task.gradient(run.t, [run.x; task.p])).' * abs (run.x);
    lift(strcmp (mode.kinds, "surface")) = 16 * eps * max (size, 1e-9);
  end
  counted = @(t, x) mode.field(t, [x; task.p]);
  stops = @(t, x) events (t, x, mode, task.p, lift, stop_at);
  first = min (max (1e-9 * task.span, 32 * eps (run.t)), 0.5 * (task.until - run.t));
  options = odeset ("RelTol", task.rtol, "AbsTol", task.atol, "Events", stops, "InitialStep", first, "Refine", 1);
  found = ode45 (counted, [run.t, task.until], run.x, options);
  run.steps += numel (found.x) - 1;
  states = found.y;
  if (rows (states) != task.states)
    states = states.';
  end
  finite = find (all (isfinite (states), 1), 1, "last");
  run.t = found.x(finite);
  run.x = states(:, finite);
  at = numel (found.ie);
  if (finite < numel (found.x))
    run = ended (run, "failed", sprintf ("the state is not finite after t = %.17g", run.t));
  elseif (at && found.xe(at) == run.t && found.ie(at) > numel (mode.kinds))
    run = ended (run, "diverged", "a state passed 1e100");
  elseif (at && found.xe(at) == run.t)
    run = follow (run, task, mode, found.ie(at));
  elseif (run.t >= task.until)
    run = ended (run, "ok", "");
  else
    run = ended (run, "failed", sprintf ("ode45 ended at t = %.17g", run.t));
  end
end

function run = do_run (task)
  stop_at = cputime () + task.seconds;
  run = struct ("status", "", "reason", "", "t", task.start, "x", task.initial, "mode", task.mode, "steps", 0,
                "drift", 0, "events", zeros (0, 3 + task.states));
  left = task.surface(run.t, [run.x; task.p]) == 0;
  while (isempty (run.status))
    index = find (cellfun (@(m) m.mode, task.modes) == run.mode);
    if (isempty (index))
      run = ended (run, "failed", "the next mode has no equations");
    elseif (task.until - run.t <= 2 * eps (task.until))
      run = ended (run, "ok", "");
    else
      try
        run = advance (run, task, task.modes{index}, left, stop_at);
      catch problem
        status = "failed";
        if (strcmp (problem.identifier, "henon_ref:timeout"))
          status = "timeout";
        end
        run = ended (run, status, problem.message);
      end
      left = true;
    end
  end
end

function text = numbers (values)
  text = ["[" strjoin(arrayfun (@(v) sprintf ("%.17g", v), values(:).', "UniformOutput", false), ",") "]"];
end

function respond (run, times)
  words = regexprep (run.reason, "[^ -~]|[\\\\\"]", " ");
  printf ("{\"protocol\":1,\"program\":{\"name\":\"ode45.m\",\"version\":\"Octave %s\"},", version ());
  printf ("\"status\":\"%s\",\"reason\":\"%s\",\"transitions\":[", run.status, words(1:min (end, 300)));
  for k = 1:rows (run.events)
    event = run.events(k, :);
    printf ("%s{\"time\":%.17g,\"before\":%d,\"after\":%d,\"state\":%s}", ifelse (k > 1, ",", ""), event(1), event(2),
            event(3), numbers (event(4:end)));
  end
  printf ("],\"max_surface_drift\":%.17g,\"wall_s\":%s,\"work\":{\"steps\":%d}", run.drift, numbers (times), run.steps);
  if (all (isfinite ([run.t; run.x])))
    printf (",\"end\":{\"time\":%.17g,\"mode\":%d,\"state\":%s}", run.t, run.mode, numbers (run.x));
  end
  printf ("}\n");
end

function text = ifelse (condition, one, other)
  if (condition)
    text = one;
  else
    text = other;
  end
end

warning ("off", "all");
request = jsondecode (fread (stdin, Inf, "char=>char").', "makeValidName", false);
problem = request.problem;
names = [reshape(problem.states, 1, []), fieldnames(problem.parameters).'];
task = struct ("p", reshape (cell2mat (struct2cell (problem.parameters)), [], 1), "states", numel (problem.states),
               "rtol", request.rtol, "atol", request.atol, "seconds", request.seconds, "most", request.most_transitions,
               "start", problem.start.time, "initial", problem.start.state(:), "mode", problem.start.mode,
               "until", problem.until, "span", problem.until - problem.start.time);
task.modes = cellfun (@(m) made_mode (m, names), as_list (problem.modes), "UniformOutput", false);
task.surface = made (problem.surface.expression, names);
task.gradient = made (problem.surface.gradient, names);
times = zeros (1, request.timed);
for k = 1 - request.untimed:request.timed
  clock_start = tic ();
  run = do_run (task);
  if (k > 0)
    times(k) = toc (clock_start);
  end
end
respond (run, times);
