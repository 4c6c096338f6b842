# `cargo sim` is a cargo alias, so bash calls cargo's completion for it. This function wraps that completion.
_isofeed_cargo() {
    local at=1
    [[ ${COMP_WORDS[1]:-} == +* ]] && at=2
    if [[ ${COMP_WORDS[at]:-} == sim && $COMP_CWORD -gt $at ]]; then
        COMP_WORDS=(cargo_sim "${COMP_WORDS[@]:at+1}")
        COMP_CWORD=$((COMP_CWORD - at))
        _cargo_sim cargo_sim "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
        return
    fi
    if declare -F "$_isofeed_before" >/dev/null; then
        "$_isofeed_before" "$@"
    fi
}
# What completes cargo so far, unless it is this one (the script was sourced before) or bash-completion's stopgap.
_isofeed_find() {
    local found
    found=$(complete -p cargo 2>/dev/null | sed -n 's/.* -F \([^ ]*\).*/\1/p')
    case $found in
    '' | _isofeed_cargo | _minimal | _comp_complete_minimal) return 1 ;;
    *) _isofeed_before=$found ;;
    esac
}
# bash-completion loads a command's completion only when it is first asked for, and cargo brings its own, which needs bash-completion.
_isofeed_load() {
    _isofeed_find && return
    if declare -F _comp_load >/dev/null; then
        _comp_load cargo
    elif declare -F _completion_loader >/dev/null; then
        _completion_loader cargo
    fi
    _isofeed_find && return
    declare -F _get_comp_words_by_ref >/dev/null || return
    local own
    own=$(rustc --print sysroot)/etc/bash_completion.d/cargo
    [[ -r $own ]] && source "$own" && _isofeed_find
}
[[ -n ${_isofeed_before:-} ]] || _isofeed_load &>/dev/null || true
complete -F _isofeed_cargo -o nosort -o bashdefault -o default cargo
