function sys = @NAME@_mechss(varargin)
%@NAME@_MECHSS  Model of klack as a sparse second-order model (MATLAB R2020b or newer).
%
%   M q'' + Dm q' + K q = Bm u,   y = Cm q + Gm q' + D u
%
%   sys = @NAME@_mechss              D = 0
%   sys = @NAME@_mechss('residual')  D holds the static compliance that the modes miss
if exist('mechss') == 0
  error('klack:mechss', ['mechss is not there: it comes with the Control System Toolbox of ' ...
    'MATLAB R2020b or newer. Use @NAME@_ss instead.']);
end
held = load(fullfile(fileparts(mfilename('fullpath')), '@NAME@.mat'));
p = held.klack;
D = p.D;
if nargin > 0 && strcmpi(varargin{1}, 'residual')
  D = p.D_with_residual_compliance;
end
sys = mechss(p.M, p.Dm, p.K, p.Bm, p.Cm, p.Gm, D);
if ~isstruct(sys)
  sys.InputName = p.input_names;
  sys.OutputName = p.output_names;
end
end
