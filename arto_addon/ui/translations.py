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
Open Photographs | Fotos öffnen | 写真を開く
Suns shine by the patches: a photographed thing is not rendered | Sonnen scheinen durch die Felder: Fotografiertes wird nicht gerendert | 太陽はパッチで照らします: 撮影されたものはレンダーできません
Read Again | Neu einlesen | 再読み込み
Ready, read {when}, {patches} patches | Bereit, eingelesen {when}, {patches} Felder | 準備完了、読み込み {when}、{patches} パッチ
The photographs are not read yet | Die Fotos sind noch nicht eingelesen | 写真はまだ読み込まれていません
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
Finish | Vollenden | 仕上げ
Finish At | Vollendet bei | 仕上げの終了
The light of frame {now}, on the shot of frame {was} | Das Licht von Bild {now}, auf der Einstellung von Bild {was} | フレーム {was} のショットに、フレーム {now} の光
Live shows the shot that it was switched on for: this is another one | Live zeigt die Einstellung, für die es eingeschaltet wurde: dies ist eine andere | ライブは、オンにしたときのショットを表示します。これは別のショットです
As in a Picture | Wie auf einem Bild | 写真のように
Match | Angleichen | マッチ
Paint Over | Übermalen | 上から描く
Even Out | Ausgleichen | 均一にする
Where From | Woher | どこから
What No Light Makes | Was kein Licht macht | どの光でも作れない部分
Do not count of the target | Zählt beim Ziel nicht | ターゲットで無視するもの
Target | Ziel | ターゲット
Target Image | Zielbild | ターゲット画像
Mask | Maske | マスク
Keep | Behalten | 維持
Change | Ändern | 変更
All Light | Alles Licht | すべての光
Strengths | Stärken | 強さ
Colours Too | Auch Farben | 色も
Scene Lamps Too | Auch Lampen der Szene | シーンのランプも
Near | Nah | 近さ
White Balance | Weißabgleich | ホワイトバランス
Save Composite | Composite speichern | 合成を保存
Web Page | Webseite | Webページ
Sheet | Bogen | 一覧
Open Page | Seite öffnen | ページを開く
Open HDRI | HDRI öffnen | HDRIを開く
Use This HDRI | Dieses HDRI verwenden | このHDRIを使う
More HDRIs | Weitere HDRIs | 他のHDRI
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
More Samples | Mehr Samples | サンプルを追加
Show Captures | Aufnahmen zeigen | キャプチャを表示
From a draft of {w} x {h}; the capture has begun | Aus einem Entwurf von {w} x {h}; die Aufnahme hat begonnen | {w} x {h} の下書きから。キャプチャが始まりました
From a draft of {w} x {h}; the capture is at tile {at} of {tiles} | Aus einem Entwurf von {w} x {h}; die Aufnahme ist bei Kachel {at} von {tiles} | {w} x {h} の下書きから。キャプチャはタイル {at} / {tiles}
From a draft of {w} x {h}; the capture stopped, {done} of {tiles} tiles are there | Aus einem Entwurf von {w} x {h}; die Aufnahme hielt an, {done} von {tiles} Kacheln sind da | {w} x {h} の下書きから。キャプチャは停止し、タイルは {done} / {tiles}
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
Of a scene of this name: {folder} | Von einer Szene dieses Namens: {folder} | 同名のシーンのもの: {folder}
A file of the shot is damaged: | Eine Datei der Einstellung ist beschädigt: | ショットのファイルが破損しています:
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
Add Group | Gruppe hinzufügen | グループを追加
Remove Group | Gruppe entfernen | グループを削除
Start | Anfang | 開始
End | Ende | 終了
Step | Schritt | ステップ
Data Window | Datenfenster | データウィンドウ
Prefix | Präfix | 接頭辞
Painted | Gemalt | ペイント
Build Hemicube | Hemicube bauen | ヘミキューブを作成
Remove Hemicube | Hemicube entfernen | ヘミキューブを削除
Fit | Anpassen | フィット
Message | Meldung | メッセージ
Recent HDRIs | Letzte HDRIs | 最近のHDRI
What relighting reads | Was das Licht braucht | リライトが読むもの
This Blender was built without Open Image Denoise | Diesem Blender fehlt Open Image Denoise | このBlenderにはOpen Image Denoiseがありません
The folder cannot be read: | Der Ordner ist nicht lesbar: | フォルダーを読めません:
Suns in the last picture: {found} | Sonnen im letzten Bild: {found} | 前回の画像の太陽: {found}
The last picture had no suns | Das letzte Bild hatte keine Sonnen | 前回の画像に太陽はありません
Compares the picture with a few samples of a render | Vergleicht das Bild mit wenigen Samples eines Renders | 画像を少数サンプルのレンダーと比べます
The camera has moved since | Die Kamera hat sich seither bewegt | カメラが動きました
Captured of the view layer {then}, this is {now} | Aufgenommen vom View-Layer {then}, dies ist {now} | ビューレイヤー {then} でキャプチャ、現在は {now}
1/{factor} of the size, after {s:.2f} s | 1/{factor} der Größe, nach {s:.2f} s | 1/{factor} サイズ、{s:.2f} 秒後
Whole, after {s:.2f} s | Ganz, nach {s:.2f} s | 全体、{s:.2f} 秒後
Whole and denoised | Ganz und entrauscht | 全体、ノイズ除去済み
{said}; the renderer beside takes {size} | {said}; der Renderer daneben braucht {size} | {said}（別レンダラーのメモリ: {size}）
Whole, without {lacks} | Ganz, ohne {lacks} | 全体、{lacks} なし
its brightness | seine Helligkeit | 明るさ
the world behind | die Welt dahinter | 背後のワールド
the HDRI's suns ({share:.0%} of its light) | die Sonnen des HDRI ({share:.0%} des Lichts) | HDRIの太陽(光の{share:.0%})
{said}: Relight adds this | {said}: kommt mit Neu beleuchten | {said}: リライトで追加
{said}: added {time} later | {said}: kommt {time} später | {said}: {time}後に追加
Finishing, with suns and denoised: {share:.0%} | Wird fertig, mit Sonnen, entrauscht: {share:.0%} | 仕上げ中(太陽、ノイズ除去): {share:.0%}
Finished: this is the plate | Fertig: dies ist die Plate | 完了: これがプレートです
The scene has no world any more: add one, and switch Live on again | Die Szene hat keine Welt mehr: eine anlegen und Live wieder einschalten | ワールドがなくなりました: 追加してライブを入れ直してください
The file has another name now: switch Live on again | Die Datei heißt jetzt anders: Live wieder einschalten | ファイル名が変わりました: ライブを入れ直してください
The shot was captured anew: switch Live on again | Neu aufgenommen: Live wieder einschalten | 再キャプチャされました: ライブを入れ直してください
The HDRI is in a node group: turn it there | Das HDRI ist in einer Knotengruppe: dort drehen | HDRIはノードグループの中です: そこで回してください
The sky is in a node group: turn it there, by its Sun Rotation | Der Himmel ist in einer Knotengruppe: dort die Sonnendrehung ändern | 空はノードグループの中です: そこで太陽の回転を変えてください
The world mixes a sky and HDRIs: turn them one by one | Die Welt mischt Himmel und HDRIs: einzeln drehen | 空とHDRIが混ざっています: 個別に回してください
The world has no HDRI or sky: it is the same from every side | Die Welt hat kein HDRI und keinen Himmel: sie ist von allen Seiten gleich | HDRIも空もありません: どこから見ても同じです
The HDRI is turned by nodes of its own: turn it there | Das HDRI wird von eigenen Knoten gedreht: dort drehen | HDRIは専用ノードで回っています: そこで回してください
The world's HDRIs are turned one by one: turn them there | Die HDRIs werden einzeln gedreht: dort drehen | HDRIは個別に回っています: そこで回してください
The world is linked from a library: make it local to change it | Die Welt ist verlinkt: zum Ändern lokal machen | ワールドはリンクです: ローカルにしてください
Your render clamps direct light at {}; the relit picture does not | Dein Render begrenzt direktes Licht auf {}; das neu beleuchtete Bild nicht | レンダーは直接光を {} で制限、リライトはしません
Your render clamps at {}; the relit picture does not | Dein Render begrenzt auf {}; das neu beleuchtete Bild nicht | レンダーは {} で制限、リライトはしません
Your render uses Fast GI; the relit picture has all its bounces | Dein Render nutzt Fast GI; das neu beleuchtete Bild hat alle Sprünge | レンダーはFast GI、リライトは全バウンスです
Your render shows the film through glass; the relit picture shows the world | Dein Render zeigt durch Glas den Film; das neu beleuchtete Bild die Welt | レンダーはガラス越しにフィルム、リライトはワールドを見せます
Your render burns metadata into the picture; the relit picture does not | Dein Render brennt Metadaten ein; das neu beleuchtete Bild nicht | レンダーはメタデータを焼き込み、リライトはしません
Your render shows the sequencer; the relit picture shows the scene | Dein Render zeigt den Sequencer; das neu beleuchtete Bild die Szene | レンダーはシーケンサー、リライトはシーンを見せます
cancelled: parts that were finished are kept | abgebrochen: fertige Teile bleiben | 中止: 完了した部分は残ります
cancelled: nothing was changed | abgebrochen: nichts wurde geändert | 中止: 変更はありません
This takes the place of a capture of {more} samples, by {fewer}: it is lost then | Dies ersetzt eine Aufnahme von {more} Samples durch {fewer}: sie ist dann verloren | {more} サンプルのキャプチャを {fewer} で置き換えます: 元には戻せません
Add Light | Licht hinzufügen | ライトを追加
Add Picture | Bild hinzufügen | 画像を追加
Remove Light | Licht entfernen | ライトを削除
Duplicate Light | Licht verdoppeln | ライトを複製
Move Light | Licht verschieben | ライトを移動
Switch Light | Licht schalten | ライトを切り替え
Kind | Art | 種類
Blend | Mischung | ブレンド
Preset | Vorlage | プリセット
Base | Grund | ベース
Backdrop | Hintergrund | 背景
No Backdrop of Its Own | Kein eigener Hintergrund | 専用の背景なし
Suns and Lamps to Lights | Sonnen und Lampen als Lichter | 太陽とランプをライトに
Save Kit | Lichtsatz speichern | ライトキットを保存
Load Kit | Lichtsatz laden | ライトキットを読み込む
Light to HDRI | Licht als HDRI | 光をHDRIに
Lights to Lamps | Lichter als Lampen | ライトをランプに
Put It There | Dorthin setzen | そこに置く
Load | Laden | 読み込み
Save | Speichern | 保存
HDRI | HDRI | HDRI
Lamps | Lampen | ランプ
Size | Größe | サイズ
Blur | Unschärfe | ぼかし
by nodes | durch Knoten | ノードによる
Reflect | Spiegeln | 反射
Rim | Kante | リム
Shade | Abschatten | 遮る
Drag: move   Wheel: size   Shift: turn   Ctrl: strength   Enter: keep   ESC, right click: back | Ziehen: bewegen   Rad: Größe   Umschalt: drehen   Strg: Stärke   Enter: behalten   ESC, Rechtsklick: zurück | ドラッグ: 移動   ホイール: サイズ   Shift: 回転   Ctrl: 強さ   Enter: 確定   ESC・右クリック: 元に戻す
Other nodes stand around the light kit: turn them and the kit there | Um den Lichtsatz stehen andere Knoten: dort drehen | ライトキットの周りに他のノードがあります: そこで回してください
The world mixes shaders, which cannot stand behind a light kit: mix their colours before one Background, or make a new world | Die Welt mischt Shader, die nicht hinter einem Lichtsatz stehen können: ihre Farben vor einem Background mischen, oder eine neue Welt anlegen | ワールドがシェーダーを混ぜています: 1つの Background の前で色を混ぜるか、新しいワールドを作ってください
Amount | Anteil | 量
Stops | Blenden | 段
Color | Farbe | カラー
Kelvin | Kelvin | ケルビン
Azimuth | Azimut | 方位
Elevation | Höhe | 仰角
Roll | Rollen | ロール
Width | Breite | 幅
Height | Höhe (Größe) | 高さ
Softness | Weichheit | 柔らかさ
Gradient | Verlauf | グラデーション
Slope | Gefälle | 傾斜
Hole | Loch | 穴
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
