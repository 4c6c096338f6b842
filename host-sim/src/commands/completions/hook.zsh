# `cargo sim` is a cargo alias, so zsh calls cargo's completion for it. This function wraps that completion.
_isofeed_cargo() {
    local at=2
    [[ ${words[2]} == +* ]] && at=3
    if [[ ${words[at]} == sim ]] && (( CURRENT > at )); then
        words=(cargo_sim "${(@)words[at+1,-1]}")
        (( CURRENT -= at - 1 ))
        _cargo_sim
        return
    fi
    if [[ -n $_isofeed_before ]]; then
        "$_isofeed_before" "$@"
    else
        _default
    fi
}
# Sourced twice, it must not go in front of itself.
if [[ ${_comps[cargo]} != _isofeed_cargo ]]; then
    typeset -g _isofeed_before=${_comps[cargo]}
fi
compdef _isofeed_cargo cargo
