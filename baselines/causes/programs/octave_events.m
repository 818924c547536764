% Minimal runs of Octave's ode45 with events. Each line of the output is a name followed by numbers.
1;

function [value, terminal, direction] = level (t, x)
  value = x(1);
  terminal = 1;
  direction = -1;
end

function [value, terminal, direction] = pair (t, x)
  value = x(1)^2 - 0.0025;
  terminal = 1;
  direction = 0;
end

function [value, terminal, direction] = two (t, x)
  value = [x(1) + 0.01; x(1)];
  terminal = [1; 1];
  direction = [-1; -1];
end

function value = root (a)
  value = NaN;
  if (a >= 0)
    value = sqrt (a);
  end
end

function value = ifelse (condition, one, other)
  value = other;
  if (condition)
    value = one;
  end
end

warning ("off", "all");
oscillator = @(t, x) [x(2); -x(1)];
for tolerance = [1e-6, 1e-9, 1e-12]
  options = odeset ("RelTol", tolerance, "AbsTol", tolerance, "Events", @level);
  [t, x, te] = ode45 (oscillator, [0, 3], [1; 0], options);
  printf ("line %g %.17g\n", tolerance, te(end));
end
[t, x, te] = ode45 (@(t, x) [x(2); -1], [0, 3], [0; 1], odeset ("RelTol", 1e-9, "AbsTol", 1e-9, "Events", @level));
printf ("ball %.17g\n", te(end));
[t, x, te] = ode45 (@(t, x) 1, [0, 2], -1, odeset ("RelTol", 1e-9, "AbsTol", 1e-9, "Events", @pair));
printf ("pair %d %.17g\n", numel (te), t(end));
[t, x, te] = ode45 (@(t, x) -1, [0, 2], 0.001, odeset ("Events", @level, "InitialStep", 0.1));
printf ("first %.17g %.17g\n", t(end), x(end));
[t, x, te, xe, ie] = ode45 (@(t, x) -1, [0, 20], 1, odeset ("Events", @two, "InitialStep", 0.5, "MaxStep", 10));
printf ("several %d %.17g\n", ie(end), te(end));
[t, x] = ode45 (@(t, x) x^2, [0, 2], 1, odeset ("RelTol", 1e-9, "AbsTol", 1e-9));
printf ("pole %.17g %.17g\n", t(end), x(end));
options = odeset ("Events", @(t, x) deal (ifelse (x > 1, NaN, 1), 1, -1));
[t, x, te] = ode45 (@(t, x) 1, [0, 2], 0, options);
printf ("nan %d %.17g\n", numel (te), t(end));
options = odeset ("RelTol", 1e-9, "AbsTol", 1e-9, "Refine", 1);
[t, x] = ode45 (@(t, x) [1; root(1 - x(1))], [0, 2], [0; 0], options);
printf ("lost %.17g %.17g %.17g\n", t(find (all (isfinite (x), 2), 1, "last")), t(end), x(end, 2));
