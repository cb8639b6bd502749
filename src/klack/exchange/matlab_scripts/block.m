function block = @NAME@_block(system)
%@NAME@_BLOCK  Put the model of klack into a Simulink diagram as a State-Space block.
%
%   open_system(new_system('plant'));
%   @NAME@_block('plant')
%
%   The matrices go into the base workspace as klack_@NAME@.
%   Input: one vector signal, the forces [N] in the order of klack_@NAME@.input_names, and last of
%   all a constant 1, which brings in the constant forces and the gaps at rest.
%   Output: one vector signal in the order of klack_@NAME@.output_names.
%   Use a variable-step solver (ode45) with a relative tolerance of 1e-6 or a step of step_s.
held = load(fullfile(fileparts(mfilename('fullpath')), '@NAME@.mat'));
p = held.klack;
p.B_block = [p.B, p.constant_rate];
p.D_block = [p.D, p.output_offset];
assignin('base', 'klack_@NAME@', p);
block = add_block('simulink/Continuous/State-Space', [system '/@NAME@'], 'MakeNameUnique', 'on');
start = 'InitialCondition';
if ~isfield(get_param(block, 'ObjectParameters'), start)
  start = 'X0';  % its name in older versions
end
set_param(block, 'A', 'klack_@NAME@.A', 'B', 'klack_@NAME@.B_block', 'C', 'klack_@NAME@.C', ...
  'D', 'klack_@NAME@.D_block', start, 'klack_@NAME@.x0', ...
  'AbsoluteTolerance', '1e-14', 'Description', strjoin(p.about(:)', char(10)));
end
