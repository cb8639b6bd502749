function sys = @NAME@_ss(varargin)
%@NAME@_SS  Linear model of klack as a state-space object.
%
%   sys = @NAME@_ss              D = 0
%   sys = @NAME@_ss('residual')  D holds the static compliance that the modes miss
%
%   Inputs are forces [N], outputs displacements [m] and velocities [m/s], all positive along +z.
%   The states are the modal displacements [m sqrt(kg)], then the modal velocities.
%   With the Control System Toolbox (or the package control of Octave) sys is an ss object,
%   without it a structure with the fields A, B, C, D and the names.
%   Of a pair it is the linear part: contact forces are inputs, gaps are outputs, and constant
%   forces and gaps at rest are klack.constant_rate and klack.output_offset of the .mat file.
held = load(fullfile(fileparts(mfilename('fullpath')), '@NAME@.mat'));
p = held.klack;
D = p.D;
if nargin > 0 && strcmpi(varargin{1}, 'residual')
  D = p.D_with_residual_compliance;
end
if exist('ss') == 0
  sys = struct('A', p.A, 'B', p.B, 'C', p.C, 'D', D, 'x0', p.x0);
  sys.StateName = p.state_names;
  sys.InputName = p.input_names;
  sys.InputUnit = p.input_units;
  sys.OutputName = p.output_names;
  sys.OutputUnit = p.output_units;
  return
end
sys = ss(p.A, p.B, p.C, D);
if exist('OCTAVE_VERSION', 'builtin')
  sys = set(sys, 'inname', p.input_names, 'outname', p.output_names, 'stname', p.state_names);
else
  sys.StateName = p.state_names;
  sys.InputName = p.input_names;
  sys.InputUnit = p.input_units;
  sys.OutputName = p.output_names;
  sys.OutputUnit = p.output_units;
  sys.Name = p.name;
end
end
