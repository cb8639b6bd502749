function [dx, y] = @NAME@_rhs(t, x, u, p)
%@NAME@_RHS  Right-hand side of the pair with its contacts, for ode45, ode15s, lsode.
%
%   p = load('@NAME@.mat'); p = p.klack;
%   u = zeros(p.force_count, 1);
%   [t, x] = ode45(@(t, x) @NAME@_rhs(t, x, u, p), [0 p.duration_s], p.x_start);
%
%   x   modal displacements, modal velocities, then the compression of each contact [m]
%       (0 without a film); p.x_start is the start of the case.
%   u   outside forces [N]: the first p.force_count names of p.input_names. A function handle
%       u(t) is taken as well.
%   y   structure: output (in the order of p.output_names: lift, velocity, gaps), contact_force
%       and film_force [N] of each contact, above zero when they press the bodies apart.
m = numel(p.omega);
q = x(1:m);
v = x(m+1:2*m);
if isa(u, 'function_handle')
  u = u(t);
end
n = numel(p.contacts);
de = zeros(n, 1);
contact = zeros(n, 1);
film = zeros(n, 1);
gap = p.gap_shapes' * q + p.gap0_m;
for k = 1:n
  c = p.contacts{k};
  e = x(2*m+k);
  if c.film_cubic == 0 && c.film_linear == 0
    contact(k) = law_force(-gap(k), c);
    continue
  end
  D = c.series_compliance_m_per_N;
  held = max(e, -D * c.film_suction_N);
  h = gap(k) + held;
  if h <= 0 && gap(k) <= 0
    contact(k) = law_force(-gap(k), c);
    de(k) = -e / p.relaxation_s;
    continue
  end
  film_gap = max(h, 0) + c.film_cut_off_m;
  damping = c.film_cubic / film_gap^3 + c.film_linear / film_gap;
  rate = p.gap_shapes(:, k)' * v;
  if D == 0
    film(k) = max(-damping * rate, -c.film_suction_N);
    continue
  end
  film(k) = held / D;
  de(k) = -(held + D * damping * rate) / max(D * damping, p.relaxation_s) ...
    + (held - e) / p.relaxation_s;
end
a = p.constant - p.omega.^2 .* q - 2 * p.damping .* p.omega .* v;
a = a + p.force_shapes * u(:) + p.gap_shapes * (contact + film);
dx = [v; a; de];
if nargout > 1
  y.output = p.C * x(1:2*m) + p.output_offset;
  y.contact_force = contact;
  y.film_force = film;
end
end

function F = law_force(closing, c)
% Force over the overlap of the bodies, closing = indentation + D F.
F = 0;
if closing <= 0 || strcmp(c.law_kind, 'none')
  return
end
D = c.series_compliance_m_per_N;
switch c.law_kind
  case 'linear'
    k = c.law_parameters(1);
    F = k * closing / (1 + D * k);
  case 'power'
    K = c.law_parameters(1);
    n = c.law_parameters(2);
    d = closing;
    if D > 0
      for step = 1:@MATLAB_TURNS@
        f = K * d^(n - 1);
        change = (d + D * f * d - closing) / (1 + D * n * f);
        d = max(d - change, 0);
        if abs(change) < @MATLAB_LEFT@ * closing
          break
        end
      end
    end
    F = K * d^n;
  case 'table'
    L = c.law_table;
    row = find(closing >= L(:, 1) + D * L(:, 2), 1, 'last');
    rest = closing - L(row, 1) - D * L(row, 2);
    s = rest;
    if D > 0
      low = 0;
      high = rest;
      s = rest / (1 + D * L(row, 3));
      for step = 1:@MATLAB_TURNS@
        excess = s + D * s * (L(row, 3) + s * (L(row, 4) + s * L(row, 5))) - rest;
        if excess < 0
          low = s;
        else
          high = s;
        end
        change = excess / (1 + D * (L(row, 3) + s * (2 * L(row, 4) + s * 3 * L(row, 5))));
        s = s - change;
        if s < low || s > high
          s = 0.5 * (low + high);
        end
        if abs(change) <= @MATLAB_LEFT@ * rest
          break
        end
      end
    end
    F = L(row, 2) + s * (L(row, 3) + s * (L(row, 4) + s * L(row, 5)));
end
end
