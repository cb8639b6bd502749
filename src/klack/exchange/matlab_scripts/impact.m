function run = @NAME@_impact(u, duration, relative)
%@NAME@_IMPACT  Simulate the pair with its contacts from the start of the case.
%
%   run = @NAME@_impact                      no outside force, duration of the case
%   run = @NAME@_impact(u, duration)         u: outside forces [N], a vector or a function of t [s]
%   run = @NAME@_impact(u, duration, 1e-11)  relative tolerance of the integrator; 1e-9 else
%
%   run.t [s], run.output (one row per time, columns as run.output_names: lift [m], velocity
%   [m/s], gaps [m]), run.contact_force, run.film_force [N], run.peak_force [N].
%   A film in series with a compliance is stiff: ode15s, or lsode in Octave. Else ode45.
held = load(fullfile(fileparts(mfilename('fullpath')), '@NAME@.mat'));
p = held.klack;
if nargin < 1 || isempty(u)
  u = zeros(p.force_count, 1);
end
if nargin < 2 || isempty(duration)
  duration = p.duration_s;
end
if nargin < 3
  relative = 1e-9;
end
stiff = false;
for k = 1:numel(p.contacts)
  c = p.contacts{k};
  stiff = stiff || ((c.film_cubic > 0 || c.film_linear > 0) && c.series_compliance_m_per_N > 0);
end
f = @(t, x) @NAME@_rhs(t, x, u, p);
t = linspace(0, duration, max(round(duration / p.step_s), 2) + 1)';
m = numel(p.omega);
absolute = relative * max(1e-6 * norm(p.rise), 1e-12) * ones(numel(p.x_start), 1);
absolute(m+1:2*m) = relative * max(norm(p.rise), 1e-6);
absolute(2*m+1:end) = relative * 1e-6;
if stiff && exist('OCTAVE_VERSION', 'builtin')
  lsode_options('relative tolerance', relative);
  lsode_options('absolute tolerance', absolute);
  lsode_options('step limit', 10000000);
  x = lsode(@(x, t) f(t, x), p.x_start, t);
else
  options = odeset('RelTol', relative, 'AbsTol', absolute, 'InitialStep', 0.1 * p.step_s, ...
    'MaxStep', 20 * p.step_s);
  if stiff
    [t, x] = ode15s(f, t, p.x_start, options);
  else
    [t, x] = ode45(f, t, p.x_start, options);
  end
end
n = numel(p.contacts);
run.t = t;
run.x = x;
run.output_names = p.output_names;
run.output = zeros(numel(t), numel(p.output_names));
run.contact_force = zeros(numel(t), n);
run.film_force = zeros(numel(t), n);
for i = 1:numel(t)
  [~, y] = f(t(i), x(i, :)');
  run.output(i, :) = y.output';
  run.contact_force(i, :) = y.contact_force';
  run.film_force(i, :) = y.film_force';
end
run.peak_force = max(run.contact_force, [], 1);
end
