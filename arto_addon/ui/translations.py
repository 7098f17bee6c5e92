"""The panels' texts in other languages: the texts read first, as sentences with places for values.

A line has English, German and Japanese. A text without a line is shown in English.
"""

from __future__ import annotations

import bpy

_LANGUAGES = ("de_DE", "ja_JP")
_LINES = """
ARTO Relighting | ARTO-Beleuchtung | ARTO リライティング
Shot | Einstellung | ショット
Light | Licht | ライト
Result | Ergebnis | 結果
Quality | Qualität | 品質
Frames | Bilder | フレーム
Layers and Footage | Ebenen und Filmmaterial | レイヤーと実写
Storage | Speicher | ストレージ
Method | Verfahren | 手法
Guide | Anleitung | ガイド
Capture | Aufnehmen | キャプチャ
Capture Again | Neu aufnehmen | 再キャプチャ
Capture This Too | Auch aufnehmen | これもキャプチャ
Continue | Fortsetzen | 続行
Set Back | Zurückstellen | 元に戻す
Use It Here | Hier verwenden | ここで使う
Cancel | Abbrechen | キャンセル
Discard Unfinished | Unfertiges verwerfen | 未完了を破棄
Relight | Neu beleuchten | リライト
Relight All | Alle neu beleuchten | すべてリライト
Show | Zeigen | 表示
Compare | Vergleichen | 比較
Look Inside | Hineinsehen | 内部を見る
Light from Here | Licht von hier | ここからの光
Verify | Prüfen | 検証
Save Composite | Composite speichern | 合成を保存
Open HDRI | HDRI öffnen | HDRIを開く
Add Look | Stimmung hinzufügen | ルックを追加
Remove Look | Stimmung entfernen | ルックを削除
Keep This Light as a Look | Dieses Licht als Stimmung behalten | この光をルックとして保存
Delete Capture, Keep Relighting | Aufnahme löschen, Licht behalten | キャプチャを削除(リライトは残す)
Capture Frames | Bilder aufnehmen | フレームをキャプチャ
Relight Frames | Bilder neu beleuchten | フレームをリライト
Mix to Scene | Mischung in die Szene | ミックスをシーンへ
Live | Live | ライブ
Show Patches | Lichtfelder zeigen | パッチを表示
Finish When Resting | In Ruhe fertigstellen | 静止時に仕上げる
Render the HDRI's Suns | Sonnen des HDRI rendern | HDRIの太陽をレンダー
Sun Samples | Sonnen-Samples | 太陽のサンプル
Scene Lamps | Lampen der Szene | シーンのランプ
Rotation | Drehung | 回転
Strength | Stärke | 強さ
Tint | Tönung | 色合い
Denoise | Entrauschen | ノイズ除去
Look | Stimmung | ルック
World Width | Weltbreite | ワールドの幅
Draft | Entwurf | 下書き
Good | Gut | 標準
Final | Endgültig | 最終
Custom | Eigene | カスタム
Samples | Samples | サンプル
Plate | Plate | プレート
Side by Side | Nebeneinander | 左右に並べる
Wipe | Wischblende | ワイプ
Render | Render | レンダー
In a Viewer | In einem Betrachter | ビューアーに
Instead of the Render | Statt des Renders | レンダーの代わりに
Footage | Filmmaterial | 実写素材
Folder | Ordner | フォルダー
Relit Picture | Neu beleuchtetes Bild | リライト画像
No capture yet | Noch keine Aufnahme | まだキャプチャがありません
The scene has no camera | Die Szene hat keine Kamera | シーンにカメラがありません
The scene has no world | Die Szene hat keine Welt | シーンにワールドがありません
This file was never saved: | Die Datei wurde nie gespeichert: | このファイルは未保存です:
save it first | erst speichern | 先に保存してください
ARTO captures with Cycles: | ARTO nimmt mit Cycles auf: | ARTOはCyclesを使います:
choose it as the engine | als Engine wählen | エンジンに選んでください
continues where it stopped | geht weiter, wo es aufhörte | 止まった所から続きます
Captured, but not fitted yet | Aufgenommen, noch nicht angepasst | キャプチャ済み、未フィット
Only the render region is captured | Nur der Renderbereich wird aufgenommen | レンダー領域のみキャプチャします
Capture the shot to see it live | Für Live erst aufnehmen | ライブにはキャプチャが必要です
Follows the world as you change it | Folgt der Welt, während du sie änderst | ワールドの変更に追従します
Layers, in the compositor | Ebenen, im Compositor | レイヤー(コンポジター)
Capture the shot first | Erst die Einstellung aufnehmen | 先にショットをキャプチャしてください
Stopping | Wird beendet | 停止中
{tiles} done, | {tiles} fertig, | {tiles} 完了、
Another capture: {tiles} done | Andere Aufnahme: {tiles} fertig | 別のキャプチャ: {tiles} 完了
Captured for {owner} | Aufgenommen für {owner} | {owner} 用のキャプチャ
Ready, captured {when}, {samples} samples | Bereit, {when}, {samples} Samples | 準備完了 {when}、{samples} サンプル
Captured through {then}, the camera is {now} | Durch {then} aufgenommen, Kamera ist {now} | {then} でキャプチャ、現在は {now}
Captured at frame {then}, this is frame {now} | Bei Bild {then} aufgenommen, jetzt {now} | フレーム {then}、現在は {now}
Captured at {then}, the picture is {now} | Mit {then} aufgenommen, Bild ist {now} | {then} でキャプチャ、現在は {now}
About {time}, {samples} samples | Etwa {time}, {samples} Samples | 約 {time}、{samples} サンプル
Perhaps {time}, {samples} samples | Vielleicht {time}, {samples} Samples | おそらく {time}、{samples} サンプル
{disk} while it runs, keeps {kept} | {disk} währenddessen, behält {kept} | 実行中 {disk}、保存 {kept}
{camera}, frame {frame}, {width} x {height} | {camera}, Bild {frame}, {width} x {height} | {camera}、フレーム {frame}、{width} x {height}
{spent} spent | {spent} vergangen | 経過 {spent}
{left} left | noch {left} | 残り {left}
{samples} samples a pixel | {samples} Samples je Pixel | {samples} サンプル/ピクセル
Look '{look}', {time} | Stimmung „{look}“, {time} | ルック「{look}」{time}
{plate}, up to date | {plate}, aktuell | {plate}、最新
{plate}, light or settings changed since | {plate}, Licht oder Einstellungen seither geändert | {plate}、光か設定が変わりました
{plate}, of an earlier capture | {plate}, von früherer Aufnahme | {plate}、以前のキャプチャ
"""


def table() -> dict[str, dict[tuple[str, str], str]]:
    """Blender's table of translations: by language, from (context, English text) to the text."""
    out: dict[str, dict[tuple[str, str], str]] = {name: {} for name in _LANGUAGES}
    for line in _LINES.strip().splitlines():
        english, *others = (part.strip() for part in line.split("|"))
        for name, text in zip(_LANGUAGES, others, strict=True):
            for context in ("*", "Operator"):
                out[name][context, english] = text
    return out


def register() -> None:
    bpy.app.translations.register(__package__, table())


def unregister() -> None:
    bpy.app.translations.unregister(__package__)
